"""Waves, and the gradient of a waveform misfit
============================================

Full-waveform inversion compares simulated with recorded traces. The adjoint method gives the derivative of
the misfit by the speed of every node for the cost of one more simulation.
"""

# %%
# Traces of one emitter: with a small fast inclusion, "recorded", and in plain water, "simulated".

import matplotlib.pyplot as plt
import numpy as np

from bentray_kernels.tomography.waveform.misfits import correlation
from bentray_kernels.wave.adjoint import misfit_gradient
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import longest_step

nodes, spacing, frequency = 141, 5e-4, 3e5  # -, m, Hz
x = spacing * np.arange(nodes)
water = np.full((nodes, nodes), 1500.0)
inclusion = water + 45.0 * np.exp(-((x[:, None] - 0.035) ** 2 + (x[None] - 0.045) ** 2) / (2 * 0.004**2))
step = 0.9 * longest_step(1550.0, spacing)
time = step * np.arange(int(75e-6 / step))
pulse = np.pi * frequency * (time - 1.2 / frequency)
wavelet = (1 - 2 * pulse**2) * np.exp(-(pulse**2))  # Ricker
emitter = np.array([0.006, 0.035])
receivers = np.column_stack((np.full(41, 0.064), np.linspace(0.006, 0.064, 41)))
recorded = simulate(Medium.from_speed(inclusion, spacing, step), emitter, receivers, wavelet)
simulated = simulate(Medium.from_speed(water, spacing, step), emitter, receivers, wavelet)

# %%
# The misfit is one minus the normalised correlation of each trace. Its gradient tells where to change the
# speed: a step against it makes the inclusion faster. For one pair alone the gradient is the sensitivity of
# a wave: wide, as a Fresnel zone, and not a thin ray.

medium, weight = Medium.from_speed(water, spacing, step), np.ones((1, 1))


def misfit_of(some):
    return misfit_gradient(
        medium, emitter, receivers[some], wavelet, lambda traces: correlation(traces, recorded[some], weight)
    )


whole, single = misfit_of(np.arange(41)), misfit_of(np.array([27]))
figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
late = 1e6 * time
axes[0].plot(late, recorded[27], label="recorded")
axes[0].plot(late, simulated[27], label="simulated in water")
axes[0].set(xlabel="time (µs)", ylabel="pressure", title="Receiver 27", xlim=(38, 50))
axes[0].legend(fontsize="small")
extent = 1e3 * np.array([0, x[-1], 0, x[-1]])
for ax, found, name in zip(axes[1:], (single, whole), ("pair", "emitter"), strict=True):
    largest = np.quantile(np.abs(found.gradient), 0.995)
    ax.imshow(-found.gradient.T, origin="lower", extent=extent, cmap="RdBu_r", vmin=-largest, vmax=largest)
    ax.plot(*(1e3 * receivers.T), "k.", markersize=2)
    ax.plot(*(1e3 * emitter), "ko", markersize=4)
    ax.add_patch(plt.Circle((35, 45), 6, fill=False, linestyle="--"))
    ax.set(title=f"Minus the gradient, one {name}", xlabel="x (mm)")
plt.show()

# %%
# Is the gradient right? Compare it with the change of the misfit for a small change of the speed.

change = np.exp(-((x[:, None] - 0.035) ** 2 + (x[None] - 0.045) ** 2) / (2 * 0.004**2))
faster, slower = (
    correlation(
        simulate(Medium.from_speed(water + s * change, spacing, step), emitter, receivers, wavelet),
        recorded,
        weight,
    )[0]
    for s in (2.0, -2.0)
)
print(
    f"gradient {(whole.gradient * change).sum():.3e}, finite difference {(faster - slower) / 4.0:.3e} per m/s"
)

# %%
# ``bentray.reconstruct(scan, "waveform", minutes=10)`` does a whole inversion, from low to high frequencies
# and for many emitters. It takes minutes: :doc:`/how-to/choose-a-method`,
# :doc:`/mathematics/full-waveform-inversion`.

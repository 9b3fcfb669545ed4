"""Full-waveform inversion
=======================

The speed of every node is changed until simulated traces equal recorded ones. The image is sharper than one
from travel times, for the whole trace is used and not its first arrival alone.
"""

# %%
# Two inclusions in water, a slow and a fast one, and 12 emitters and 48 receivers around them. The traces are
# simulated on a grid twice as fine as that of the inversion, of waves of 220 kHz.

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize

from bentray_kernels.tomography.waveform.misfits import correlation
from bentray_kernels.wave.adjoint import misfit_gradient
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import longest_step

side, water, frequency = 0.05, 1500.0, 2.2e5  # m, m/s, Hz


def object_on(nodes):
    """The true speed."""
    x, y = np.meshgrid(*2 * [np.linspace(0.0, side, nodes)], indexing="ij")
    speed = np.full((nodes, nodes), water)
    speed[(x - 0.02) ** 2 + (y - 0.022) ** 2 < 0.006**2] = 1470.0
    speed[(x - 0.031) ** 2 + (y - 0.03) ** 2 < 0.004**2] = 1540.0
    return speed


nodes = 51
spacing, finer = side / (nodes - 1), side / (2 * nodes - 2)  # m
step = 0.9 * longest_step(1600.0, finer)
time = step * np.arange(int(50e-6 / step))
pulse = np.pi * frequency * (time - 1.2 / frequency)
wavelet = (1 - 2 * pulse**2) * np.exp(-(pulse**2))  # Ricker
angle = 2 * np.pi * np.arange(48) / 48
ring = side / 2 + 0.021 * np.column_stack((np.cos(angle), np.sin(angle)))
true = object_on(nodes)
fine = Medium.from_speed(object_on(2 * nodes - 1), finer, step)
recorded = [simulate(fine, ring[e], ring, wavelet) for e in range(0, 48, 4)]

# %%
# The misfit of all emitters and its gradient, and some iterations of a quasi-Newton method. Nodes at the
# elements are kept: their gradient is large and says nothing about the object.

inside = np.hypot(*(np.indices((nodes, nodes)) * spacing - side / 2)) < 0.017
weight = np.ones((1, 1))


def misfit(change):
    speed = np.full((nodes, nodes), water)
    speed[inside] += change
    medium = Medium.from_speed(speed, spacing, step)
    total, gradient = 0.0, np.zeros((nodes, nodes))
    for e, traces in zip(range(0, 48, 4), recorded, strict=True):
        found = misfit_gradient(
            medium, ring[e], ring, wavelet, lambda made, traces=traces: correlation(made, traces, weight)
        )
        total, gradient = total + found.misfit, gradient + found.gradient
    errors.append(np.sqrt(np.mean((speed - true)[inside] ** 2)))
    return total, gradient[inside]


errors = []
found = minimize(
    misfit, np.zeros(inside.sum()), jac=True, method="L-BFGS-B", options={"maxiter": 15, "gtol": 0.0}
)
image = np.full((nodes, nodes), water)
image[inside] += found.x

# %%
# The image beside the truth, and its error over the simulations of all emitters. Water alone is the start.

figure, axes = plt.subplots(1, 3, figsize=(11, 3.5), layout="constrained")
for ax, (name, speed) in zip(axes[:2], {"truth": true, "image": image}.items(), strict=True):
    shown = ax.imshow(speed.T, origin="lower", extent=(0, 1e3 * side) * 2, vmin=1460, vmax=1550)
    ax.plot(*(1e3 * ring.T), "k.", markersize=2)
    ax.set(title=name, xlabel="x (mm)")
figure.colorbar(shown, ax=axes[:2], label="sound speed (m/s)")
axes[2].plot(errors)
axes[2].axhline(np.std(true[inside]), color="black", linestyle=":", label="best constant")
axes[2].set(xlabel="gradients", ylabel="error (m/s rms)", ylim=(0, None))
axes[2].legend()
plt.show()
print(f"{errors[-1]:.1f} m/s rms; best constant {np.std(true[inside]):.1f}, water {errors[0]:.1f}")

# %%
# ``bentray.reconstruct(scan, "waveform")`` does the same from raw traces: it estimates the pulse, starts at
# the image of rays, goes from low to high frequencies and is judged by emitters that it has not used. That
# takes minutes: :doc:`/how-to/choose-a-method`, :doc:`/mathematics/full-waveform-inversion`.

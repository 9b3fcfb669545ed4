"""Attenuation
===========

From amplitudes along the rays of the speed image. Attenuation images are experimental: compare them with a
constant.
"""

# %%
# A scan with amplitudes, computed as line integrals: ideal data, without diffraction.

import matplotlib.pyplot as plt
import numpy as np

import bentray

scan = bentray.simulate(elements=64, nodes=64, coupling_mps=1375.0, attenuation=True)
result = bentray.reconstruct(scan, "gauss-newton", nodes=64, attenuation=True)
found = result.compare(quantity="attenuation")

figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.6), layout="constrained", sharey=True)
true = scan.truth.attenuation_np_m
shown = axes[0].imshow(
    true.T, origin="lower", extent=(-100, 100) * 2, vmin=0, vmax=np.nanmax(true), cmap="magma"
)
axes[0].set(title="phantom", xlabel="x (mm)", ylabel="y (mm)")
figure.colorbar(shown, ax=axes[0], label="attenuation (Np/m)")
result.plot("attenuation", low=0, high=np.nanmax(true), ax=axes[1])
result_range = np.ptp(found.other[found.region])
axes[1].set_title(f"along bent rays: {found.rms / result_range:.0%} of the range")
plt.show()

# %%
# The same error of the best constant, and of straight rays:

straight = bentray.reconstruct(scan, "gauss-newton", rays="straight", nodes=64, attenuation=True).compare(
    quantity="attenuation"
)
print(f"bent rays {found.rms / result_range:.0%}, straight rays {straight.rms / result_range:.0%}", end=", ")
print(f"constant {np.std(found.other[found.region]) / result_range:.0%} of the range, rms")

# %%
# In the unit of tissue: 8.686 dB is 1 Np; see :doc:`/mathematics/attenuation-and-reflection`.

result.save("attenuation.nrrd", "attenuation", attenuation="dB/cm/MHz", frequency_hz=1e6)

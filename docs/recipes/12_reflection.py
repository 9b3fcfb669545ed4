"""Reflection along bent rays
==========================

The same traces hold echoes. With the delays along the bent rays of the speed image they are focused where
they came from; with those of water, to which speed bounds keep the second image, they are not.
"""

# %%
# A small scan of waves. The echoes of smooth tissue are weak; edges between tissues show best.

import matplotlib.pyplot as plt

import bentray

scan = bentray.simulate(waveform=True, elements=64, emissions=24, nodes=64, frequency_hz=3e5, side_m=0.06)
settings = {"nodes": 64, "reflection": True}
bent = bentray.reconstruct(scan, "gauss-newton", **settings)
water = bentray.reconstruct(scan, "sart", speed_bounds_mps=(1499.9, 1500.1), iterations=1, **settings)

figure, axes = plt.subplots(1, 3, figsize=(11, 3.5), layout="constrained")
bent.plot(ax=axes[0])
for ax, (name, image) in zip(axes[1:], {"reconstructed": bent, "water": water}.items(), strict=True):
    image.plot("reflection", low=-50, high=0, ax=ax)
    ax.set_title(f"echoes, delays: {name}", fontsize="medium")
plt.show()

# %%
# The pixels of the reflection are finer than the nodes of the speed, an eighth of the wavelength:

print(bent.reflection.shape, "pixels,", bent.speed.shape, "nodes")

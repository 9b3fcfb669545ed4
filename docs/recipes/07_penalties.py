"""Strength of the penalty of Gauss–Newton
=======================================

Total variation keeps edges. The stronger it is, the flatter the image: noise goes first, then detail.
"""

# %%
# A noisy scan (signal to noise 30), and images of three strengths.

import matplotlib.pyplot as plt
import numpy as np

import bentray

scan = bentray.simulate(elements=48, nodes=48, coupling_mps=1400.0, snr=30.0)
strengths = (0.03, 0.3, 3.0)
figure, axes = plt.subplots(1, 3, figsize=(11, 3.5), layout="constrained")
for ax, strength in zip(axes, strengths, strict=True):
    image = bentray.reconstruct(scan, "gauss-newton", nodes=48, penalty_strength=strength)
    found = image.compare()
    image.plot(low=1360, high=1570, ax=ax)
    ax.set_title(f"{strength:g}: {found.rms:.1f} m/s", fontsize="medium")
    ax.set(xlabel="", ylabel="")
plt.show()

# %%
# The errors need the truth, which a real scan does not have: ``auto`` compares strengths by held-out pairs.
# For comparison, the best constant image:

print(f"constant: {np.std(found.other[found.region]):.1f} m/s rms")

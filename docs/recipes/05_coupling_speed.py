"""The speed of the water decides
==============================

The same breast in water as slow as its fat, and in faster water. Bent rays help a lot in the first and
little in the second, where no first arrival crosses the depth of the fat.
"""

# %%
# Scans with 64 elements, images by SART with three iterations. The mean absolute error is over the range of
# the phantom, inside the breast; below it that of the best constant, to which every image must be compared.

import matplotlib.pyplot as plt
import numpy as np

import bentray

figure, axes = plt.subplots(2, 3, figsize=(9.5, 6), layout="constrained", sharex=True, sharey=True)
for row, water in zip(axes, (1375.0, 1500.0), strict=True):
    scan = bentray.simulate(elements=64, nodes=64, coupling_mps=water)
    for ax, rays in zip(row[1:], ("straight", "curved"), strict=True):
        result = bentray.reconstruct(scan, "sart", rays=rays, nodes=64, iterations=3)
        found = result.compare()
        true = found.other[found.region]
        error = found.mean_absolute / np.ptp(true)
        constant = np.mean(np.abs(true - np.median(true))) / np.ptp(true)
        result.plot(low=1360, high=1570, ax=ax)
        ax.set_title(f"{rays} rays: {error:.0%} (constant {constant:.0%})", fontsize="medium")
        ax.set_ylabel("")
    ax = row[0]
    half = 100.0
    ax.imshow(found.other.T, origin="lower", extent=(-half, half) * 2, vmin=1360, vmax=1570, cmap="viridis")
    ax.set_title(f"phantom, water {water:g} m/s", fontsize="medium")
    ax.set_ylabel("y (mm)")
plt.show()

# %%
# :doc:`/explanation/when-bent-rays-help` explains why, and :doc:`/how-to/calibrate` how to choose the
# water.

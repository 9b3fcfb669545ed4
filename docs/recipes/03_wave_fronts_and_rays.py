"""Wave fronts and bent rays
=========================

The wave front of one emitter through a breast, the rays that follow its gradient, and the travel time as
the sum of the slowness along a ray.
"""

# %%
# Solve the Eikonal equation for one emitter, and trace a ray from each receiver.

import matplotlib.pyplot as plt
import numpy as np

from bentray_kernels import eikonal, rays
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6

nodes, half = 160, TABLE6_SIDE_M / 2
spacing = TABLE6_SIDE_M / (nodes - 1)  # m
angle = np.radians(np.linspace(110, 250, 25))
receivers = half + 0.092 * np.column_stack((np.cos(angle), np.sin(angle)))
source = np.array([half + 0.092, half])

figure, axes = plt.subplots(1, 2, figsize=(9, 4.2), layout="constrained", sharey=True)
for ax, water in zip(axes, (1375.0, 1500.0), strict=True):
    speed = table6(water).speed(nodes, TABLE6_SIDE_M)
    time = eikonal.solve(speed, spacing, source)
    extent = 1e3 * np.array([-half, half, -half, half])
    shown = ax.imshow(speed.T, origin="lower", extent=extent, cmap="Blues_r", vmin=1350, vmax=1570)
    ax.contour(1e6 * time.T, levels=np.arange(5, 150, 5), extent=extent, colors="white", linewidths=0.6)
    for path in rays.trace(time, spacing, receivers, source):
        ax.plot(*(1e3 * (path - half)).T, color="#d1495b", linewidth=0.9)
    ax.set(title=f"Water of {water:g} m/s", xlabel="x (mm)")
axes[0].set_ylabel("y (mm)")
figure.colorbar(shown, ax=axes, label="sound speed (m/s)")

# %%
# In fast water the first arrival goes round the slow layer of fat: its rays do not cross it.
#
# The sensitivities are the lengths of each ray in each node, a sparse matrix. Times its slowness they give
# the travel times; the difference from the times on the grid shows how accurate both are.

matrix = rays.sensitivities(time, spacing, receivers, source)
along_rays = matrix @ (1.0 / speed).ravel()
bent = rays.travel_times(time, speed, spacing, receivers, source)
print(f"{matrix.nnz} lengths other than 0; those of the first ray sum to {matrix.sum(axis=1)[0]:.4f} m")
largest = 1e9 * np.abs(along_rays - bent).max()
print(f"sum along the ray minus ray moved to the path of least time: {largest:.1f} ns at most")

"""Solvers of the Eikonal equation
===============================

Travel times from a point source through a breast, and the error of each solver at a ring of receivers. The
reference is the solution on a grid four times as fine.
"""

# %%
# The medium is the 2-D breast phantom (Li 2008, Table 6) with smooth edges, in water of 1500 m/s.

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from bentray_kernels import eikonal
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6

nodes, finer = 97, 4
spacing = TABLE6_SIDE_M / (nodes - 1)  # m
fine = gaussian_filter(table6(1500.0).speed((nodes - 1) * finer + 1, TABLE6_SIDE_M), 2.0 * finer)
speed = fine[::finer, ::finer]
source = np.array([0.1 * TABLE6_SIDE_M, 0.5 * TABLE6_SIDE_M])
reference = eikonal.solve(fine, spacing / finer, source)[::finer, ::finer]

# %%
# Receivers on a ring of 90 mm; the error is read there, by the same interpolation for all solvers.

angle = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
ring = (0.5 * TABLE6_SIDE_M + 0.09 * np.array([np.cos(angle), np.sin(angle)])) / spacing


def at_ring(times):
    return map_coordinates(times, ring, order=3)


errors = {}
for method in ("accurate", "hafmm", "fmm", "fmm-first-order", "fsm", "fim"):
    times = eikonal.solve(speed, spacing, source, method)
    errors[method] = np.sqrt(np.mean((at_ring(times) - at_ring(reference)) ** 2))
    print(f"{method:16s} {1e9 * errors[method]:7.1f} ns rms")

# %%
# Solvers that treat the singularity of the source (``accurate``, ``hafmm``) are more accurate by one to two
# orders of magnitude. The formulas are on :doc:`/mathematics/eikonal`.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
extent = 1e3 * np.array([0, TABLE6_SIDE_M, 0, TABLE6_SIDE_M])
image = left.imshow(speed.T, origin="lower", extent=extent, cmap="Blues_r")
left.contour(1e6 * times.T, levels=20, extent=extent, colors="white", linewidths=0.6)
left.plot(*(1e3 * source), "o", color="black")
left.set(xlabel="x (mm)", ylabel="y (mm)", title="Wave fronts, every 7 µs")
figure.colorbar(image, ax=left, label="sound speed (m/s)")
right.barh(list(errors), [1e9 * error for error in errors.values()], color="#1d6996")
right.set(xscale="log", xlabel="error at the ring (ns rms)", title=f"Error with {nodes} x {nodes} nodes")
right.invert_yaxis()
plt.show()

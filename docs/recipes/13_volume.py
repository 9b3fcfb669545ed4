"""Three dimensions: rays through a volume
=======================================

Elements on four rings at different heights receive each other, so that rays run in all directions of space.
One volume is reconstructed.
"""

# %%
# A ball with a fast core off its middle, in water. Travel times are computed on a finer grid than the
# image.

import h5py
import matplotlib.pyplot as plt
import numpy as np

import bentray
from bentray_kernels import eikonal, rays

nodes, side = 41, 0.12  # -, m
spacing = side / (nodes - 1)
line = spacing * np.arange(nodes) - side / 2
x, y, z = np.meshgrid(line, line, line, indexing="ij")
true = np.full(x.shape, 1500.0)
true[x**2 + y**2 + z**2 < 0.03**2] = 1460.0
true[(x - 0.01) ** 2 + y**2 + (z - 0.005) ** 2 < 0.011**2] = 1540.0
angle = 2 * np.pi * (np.arange(16)[None] + 0.25 * np.arange(4)[:, None]) / 16
height = np.broadcast_to(np.array([-0.036, -0.012, 0.012, 0.036])[:, None], angle.shape)
position = np.stack((0.054 * np.cos(angle), 0.054 * np.sin(angle), height), axis=-1).reshape(-1, 3)

delta = np.full((64, 64), np.nan)
for e, source in enumerate(position):
    tof = eikonal.solve(true, spacing, source + side / 2)
    others = np.arange(64) > e  # one direction of each pair is enough
    if others.any():
        times = (
            rays.sensitivities(tof, spacing, position[others] + side / 2, source + side / 2)
            @ (1 / true).ravel()
        )
        delta[e, others] = times - np.linalg.norm(position[others] - source, axis=1) / 1500.0

# %%
# Write the scan, and reconstruct it as one volume; rings at several heights are slices otherwise. Coarse
# nodes keep this example short; the time grows with their cube.

with h5py.File("rings.h5", "w") as file:
    file.attrs.update(format="uct-transmission", format_version="1.0", dimension=3)
    file["geometry/element_position_m"] = position
    file["geometry"].attrs["array_type"] = "free"
    file["acquisition/tx"] = np.arange(64)
    file["acquisition/rx"] = np.arange(64)
    file.create_group("water").attrs["sound_speed_mps"] = 1500.0
    file["traveltime/delta_tof_s"] = delta
result = bentray.reconstruct("rings.h5", "gauss-newton", decomposition="volume", nodes=28, iterations=3)
print(result)

# %%
# A horizontal and a vertical section beside the truth.

figure, axes = plt.subplots(1, 3, figsize=(11, 3.5), layout="constrained")
extent = (-60, 60) * 2
axes[0].imshow(true[:, nodes // 2].T, origin="lower", extent=extent, vmin=1450, vmax=1545)
axes[0].set(title="truth, y = 0", xlabel="x (mm)", ylabel="z (mm)")
result.plot(axis="y", low=1450, high=1545, ax=axes[1])
axes[1].set_title("image, y = 0")
result.plot(low=1450, high=1545, ax=axes[2])
axes[2].set_title("image, z = 0")
plt.show()

# %%
# As a dataset of xarray (``pip install "bentray[xarray]"``), with coordinates and units: a profile by
# position in m, and the error at the nodes of the image.

import xarray

images = result.to_xarray()
truth = xarray.DataArray(true, coords={"x": line, "y": line, "z": line})
figure, ax = plt.subplots(figsize=(6.4, 3.4), layout="constrained")
for name, volume in {"truth": truth, "image": images.speed}.items():
    volume.sel(y=0.0, z=0.005, method="nearest").plot(ax=ax, label=name)
ax.set_title("profile through the core, y = 0, z = 5 mm")
ax.legend()
plt.show()

there = truth.reindex_like(images, method="nearest")
inside = images.x**2 + images.y**2 + images.z**2 < 0.036**2
error = ((images.speed - there).where(inside) ** 2).mean() ** 0.5
print(f"{error:.1f} m/s rms within 36 mm; constant {there.where(inside).std():.1f}")

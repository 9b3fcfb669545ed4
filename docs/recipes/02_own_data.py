"""Your own travel times
=====================

Two arrays are enough: the positions of the elements, and for each pair the arrival time with the object
minus that in water. Here they are computed for a slow disc, along straight lines.
"""

# %%
# Replace these arrays by yours. A missing pair is ``NaN``; one direction of each pair is enough.

import h5py
import matplotlib.pyplot as plt
import numpy as np

import bentray

elements, radius, water = 48, 0.09, 1482.0  # -, m, m/s
angle = 2 * np.pi * np.arange(elements) / elements
position = radius * np.column_stack((np.cos(angle), np.sin(angle)))  # m
middle = (position[:, None] + position[None]) / 2
distance = np.linalg.norm(middle - [0.02, 0.0], axis=2)
# Half the chord through a disc of 30 mm around (20 mm, 0), for lines through its middle parallel to the
# pair.
normal = position[:, None] - position[None]
length = np.linalg.norm(normal, axis=2)
across = normal / np.where(length > 0, length, 1.0)[..., None]
offset = np.abs(
    (middle - [0.02, 0.0])[..., 0] * across[..., 1] - (middle - [0.02, 0.0])[..., 1] * across[..., 0]
)
chord = 2 * np.sqrt(np.maximum(0.03**2 - offset**2, 0.0))
delta = chord * (1 / 1450.0 - 1 / water)  # s
delta[np.eye(elements, dtype=bool)] = np.nan

# %%
# Look at the data before the reconstruction: a map of times over emitters and receivers shows dead elements
# as lines, and wrong positions as jumps.

figure, ax = plt.subplots(figsize=(5, 4), layout="constrained")
shown = ax.imshow(1e6 * delta, cmap="viridis")
ax.set(xlabel="receiver", ylabel="emitter", title="Travel-time difference")
figure.colorbar(shown, label="µs")

# %%
# Write the file (see :doc:`/reference/scan-file` for all that it may hold) and reconstruct it.

with h5py.File("disc.h5", "w") as file:
    file.attrs.update(format="uct-transmission", format_version="1.0", dimension=2)
    file["geometry/element_position_m"] = position
    file["acquisition/tx"] = np.arange(elements)
    file["acquisition/rx"] = np.arange(elements)
    file.create_group("water").attrs["sound_speed_mps"] = water
    file["traveltime/delta_tof_s"] = delta

scan = bentray.read("disc.h5")
print(scan)
image = bentray.reconstruct(scan, "gauss-newton", nodes=64)

# %%
# The disc has 1450 m/s. These times follow straight lines, so that straight rays would be the right model
# here.

ax = image.plot()
ax.add_patch(plt.Circle((20, 0), 30, fill=False, color="white", linestyle="--"))
ax.set_title("Speed; dashed: the true disc")
nearest = [int(np.argmin(np.abs(image.coordinates[axis] - at))) for axis, at in (("x", 0.02), ("y", 0.0))]
print(f"in the middle of the disc {image.speed[tuple(nearest)]:.0f} m/s")

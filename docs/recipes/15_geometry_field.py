"""A geometry field
================

A table of all rays through the cube around a mesh replaces the search for the face that a ray hits. Here it
draws a ring of glass.
"""

# %%
# Flatten the mesh to a square, and fill the table: twelve samples along each edge of the cube.

import matplotlib.pyplot as plt
import numpy as np

from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from bentray_kernels.geometry_field.tables.outer_field import build_rows, outer_field
from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.scene import Ground, Instance, Material, Scene, Shape, placed
from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.refraction import perspective

samples = 12
found = parameterise(torus(40, 28))
surface = surface_of(found.chart)
outer = outer_field(samples, [build_rows(surface, samples, 0, 6 * samples**2)])
points, starts = spread_points(surface, 8)
inner = inner_field(samples, starts, [build_inner_rows(surface, samples, points)])
print(f"{outer.faces.size} rays from outside, {inner.faces.size} from the surface")
print(f"area stretch {found.area_stretch:.2f}")

# %%
# The geometry image: each pixel is a place of the surface, shown as a colour. Then pictures by table
# lookup, and by exact intersection for comparison.

instance = Instance(Shape(surface, outer, inner), placed((0, 0, 0.2), 2.0), Material(glass=1.0, index=1.4))
sky = np.linspace([0.55, 0.7, 0.95], [0.95, 0.95, 0.9], 32)[:, None].repeat(64, axis=1)
scene = Scene((instance,), sky, Ground(-0.5, 0.25, 8.0))
camera = perspective(eye=(2.2, -2.4, 1.9), target=(0, 0, 0), up=(0, 0, 1), view_deg=38.0)
image = geometry_image(found.chart, 96)

figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.7), layout="constrained")
axes[0].imshow(image.positions, origin="lower")
axes[0].set_title("geometry image")
pictures = {}
for ax, way in zip(axes[1:], ("walk", "exact"), strict=True):
    pictures[way] = trace(world_of(scene), camera, TraceSettings(rows=200, columns=200, way=way))
    ax.imshow(pictures[way])
    ax.set_title({"walk": "by lookup", "exact": "by exact intersection"}[way])
for ax in axes:
    ax.axis("off")
plt.show()
different = np.abs(pictures["walk"].astype(int) - pictures["exact"]).max(axis=2) > 16
print(f"{different.mean():.1%} of the pixels differ by more than 16 of 255")

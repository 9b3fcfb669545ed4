"""Filters and refraction
======================

A glass ball in front of a checkerboard. Refraction follows the gradient of the filtered volume, so that it
shows errors of the filter that an ordinary picture hides.
"""

# %%
# The ball is rounded to 8 bits, as a volume of a scanner is.

import matplotlib.pyplot as plt
import numpy as np

from bentray_kernels.phantoms import FringeSphere, eight_bit, sampled
from bentray_kernels.refraction import Layers, RenderSettings, Scene, perspective, render
from bentray_kernels.refraction.backdrop import backdrop_of, checkerboard
from bentray_kernels.splines import Spline

ball = FringeSphere(radius=0.5, fringe=0.15)
volume = eight_bit(sampled(ball, 48), 0.0, 1.0)
iso = 0.5 * float(volume.max())
camera = perspective(eye=(0.0, -4.0, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, 1.0), view_deg=26.0)
board = backdrop_of([checkerboard((0.0, 1.5, 0.0), (3.0, 0.0, 0.0), (0.0, 0.0, -3.0), squares=24)])
settings = RenderSettings(rows=192, columns=192)

# %%
# Trilinear interpolation, the cubic B-spline, and the cubic smoothing spline.

filters = {
    "trilinear": Spline.from_volume(volume, "trilinear"),
    "cubic B-spline": Spline(volume, order=3),
    "cubic, smoothing 1": Spline(volume, order=3, smoothing=1.0),
}
figure, axes = plt.subplots(1, 3, figsize=(10, 3.6), layout="constrained")
for ax, (name, spline) in zip(axes, filters.items(), strict=True):
    scene = Scene.build(spline, Layers((iso,), (1.0, 1.5)), spacing_m=2.0 / 47)
    ax.imshow(render(scene, camera, board, settings).image)
    ax.set_title(name)
    ax.axis("off")
plt.show()

# %%
# How far are the normals off? Along a circle on the ball, where the true normal is radial:

points = np.random.default_rng(0).normal(size=(4000, 3))
points = ball.iso_radius(0.5) * points / np.linalg.norm(points, axis=1, keepdims=True)
for name, spline in filters.items():
    slope = spline.gradient((points + 1.0) * 0.5 * 47)
    cosine = -(slope * points).sum(axis=1) / np.linalg.norm(slope, axis=1) / np.linalg.norm(points, axis=1)
    print(f"{name:22s} {np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean():5.2f} degrees on average")

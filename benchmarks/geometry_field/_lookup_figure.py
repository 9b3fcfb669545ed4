"""Figure 25: a body rendered by the published lookups and by ours."""

import numpy as np

from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.refraction import perspective
from bentray_kernels.refraction.supersampling import averaged

from ..shared._pictures import Panel
from ._field_lookups import PIXELS, SAMPLES, Lookups, between_pixels
from ._field_rays import load_mesh

EYE, LIGHT = (0.75, 0.75, 2.2), np.array([0.4, 0.5, 0.75])
CLAY, SKY = np.array([0.85, 0.66, 0.5]), np.array([0.85, 0.9, 0.97])

NAMES = {
    "nearest uv": "nearest (u, v), as published",
    "linear uv": "4-D linear (u, v), as published",
    "walk": "walk from the nearest entry's\nface, as we do",
}


def lookup_panels(pixels: int) -> list[Panel]:
    """The body in clay, by three lookups."""
    chart = parameterise(load_mesh()[1]).chart
    image, lookups = geometry_image(chart, PIXELS), Lookups.from_chart(chart, SAMPLES)
    camera = perspective(EYE, (0.45, 0.5, 0.5), (0.0, 1.0, 0.0), 38.0)
    position = (np.arange(2 * pixels) + 0.5) / (2 * pixels) - 0.5
    u, v = np.tile(position, 2 * pixels)[:, None], np.repeat(position, 2 * pixels)[:, None]
    ahead = camera.direction[0] + u * camera.direction[1] + v * camera.direction[2]
    rays = np.float32(np.broadcast_to(camera.origin[0], ahead.shape)), np.float32(ahead)
    runs, results = lookups.runs(rays)
    panels = []
    for way, words in NAMES.items():
        runs[way]()
        if way.endswith("uv"):
            normals = between_pixels(image, image.normals, results[way])
        else:
            normals = lookups.normals(results["faces"], results["weights"])
        panels.append(Panel(words, shaded(normals, 2 * pixels)))
    return panels


def shaded(normals: np.ndarray, pixels: int) -> np.ndarray:
    """Clay under a light, half as many pixels along each side; NaN is sky."""
    light = LIGHT / np.linalg.norm(LIGHT)
    with np.errstate(invalid="ignore"):
        shown = 0.25 + 0.75 * np.clip(normals @ light / np.linalg.norm(normals, axis=1), 0.0, 1.0)
    colours = np.where(np.isfinite(shown)[:, None], shown[:, None] * CLAY, SKY)
    return averaged(np.uint8(255.0 * colours.reshape(pixels, pixels, 3) + 0.5), 2)

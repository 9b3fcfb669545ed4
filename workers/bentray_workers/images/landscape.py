"""A procedural panorama: sky, sun, hills and striped fields."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

ROWS = 768

Colours = NDArray[np.float32]
Pixels = NDArray[np.floating]

ZENITH, HORIZON, SUN, WOODS, NEAR, FAR = np.array(
    [
        (0.4, 0.6, 0.9),
        (0.9, 0.92, 0.95),
        (1, 1, 1),
        (0.22, 0.4, 0.24),
        (0.72, 0.62, 0.36),
        (0.48, 0.54, 0.26),
    ],
    dtype=np.float32,
)


@cache
def landscape() -> Colours:
    """(768, 1536, 3) float32 RGB, 0 to 1: rows from the zenith to the nadir, columns round."""
    positions = (np.arange(2 * ROWS, dtype=np.float32) + 0.5) / ROWS
    v, u = positions[:ROWS, np.newaxis], positions[np.newaxis]
    angle, height = np.pi * u, 0.5 - v
    ridge = 0.05 + 0.03 * np.sin(2 * angle + 0.5) + 0.018 * np.sin(7 * angle) + 0.006 * np.sin(19 * angle)
    pale = (v / 0.5)[..., np.newaxis] ** 3
    picture = (1.0 - pale) * ZENITH + pale * HORIZON
    away = np.hypot((u - 0.55) * np.cos(np.pi * height), height - 0.25)
    picture = _over(picture, 0.035 - away, SUN)
    picture = _over(picture, ridge - height, WOODS)
    striped = _over(FAR, np.sin(20 * angle) / 64.0, NEAR)
    shade = np.clip(1.0 + 0.8 * height, 0.5, 1.0)[..., np.newaxis]
    return _over(picture, -height, striped * shade)


def _over(picture: Pixels, inside: Pixels, colour: Pixels) -> Colours:
    """Blend a colour where ``inside`` is above 0, with an edge one pixel wide."""
    cover = np.clip(inside * ROWS + 0.5, 0.0, 1.0)[..., np.newaxis]
    return np.asarray((1.0 - cover) * picture + cover * colour, dtype=np.float32)

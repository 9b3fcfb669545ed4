"""From places on the backdrop to pixels: by points, by post-refraction or by real supersampling (4.3.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compiled import kernel
from .backdrop import Backdrop, Colours, colour_at

Planes = NDArray[np.int8]
Crossed = NDArray[np.int16]


@kernel
def point_colours(
    backdrop: Backdrop, planes: Planes, places: Floats, weights: Floats, image: Colours
) -> None:
    """One sample a pixel.

    Args:
        backdrop: what is seen.
        planes: (rows, columns) as ``locate`` gives them.
        places: (rows, columns, 2).
        weights: (rows, columns) share of the light that arrives.
        image: (rows, columns, 3), filled.
    """
    rows, columns = planes.shape
    for i in range(rows):
        for j in range(columns):
            colour = colour_at(backdrop, planes[i, j], places[i, j, 0], places[i, j, 1])
            for c in range(3):
                image[i, j, c] = np.uint8(colour[c] * weights[i, j] + 0.5)


@kernel
def post_refraction_colours(
    backdrop: Backdrop,
    planes: Planes,
    places: Floats,
    crossed: Crossed,
    weights: Floats,
    degree: int,
    image: Colours,
) -> None:
    """Post-refraction supersampling (PRSS): no more rays, only more samples of the backdrop.

    The places of a pixel and its 8 neighbours show how the object distorts the grid of pixels. Between the
    pixel and each neighbour, out to half way, lie ``degree`` places more each way; the backdrop is read there
    and the colours are averaged with the trapezoidal weights of the pixel's area, for degree 1 the binomial
    ¼ ½ ¼. A neighbour whose ray met another number of interfaces, or ended on another plane, belongs to
    another piece of the picture: nothing lies between it and the pixel, whose own colour stands in.

    Args:
        backdrop, planes, places, weights: as for ``point_colours``.
        crossed: (rows, columns) interfaces met by the ray.
        degree: 1 for the 8 intermediate places of the dissertation, more for 2·degree + 1 squared.
        image: (rows, columns, 3), filled.
    """
    rows, columns = planes.shape
    for i in range(rows):
        for j in range(columns):
            own = colour_at(backdrop, planes[i, j], places[i, j, 0], places[i, j, 1])
            red = green = blue = total = 0.0
            if not _alike_around(backdrop, planes, places, crossed, i, j):
                for a in range(-degree, degree + 1):
                    for b in range(-degree, degree + 1):
                        weight = (0.5 if abs(a) == degree else 1.0) * (0.5 if abs(b) == degree else 1.0)
                        place, found = _between(planes, places, crossed, i, j, a / degree, b / degree)
                        colour = colour_at(backdrop, planes[i, j], place[0], place[1]) if found else own
                        red += weight * colour[0]
                        green += weight * colour[1]
                        blue += weight * colour[2]
                        total += weight
            if total > 0.0:
                own = (red / total, green / total, blue / total)
            for c in range(3):
                image[i, j, c] = np.uint8(own[c] * weights[i, j] + 0.5)


@kernel(inline="always")
def _between(
    planes: Planes, places: Floats, crossed: Crossed, i: int, j: int, down: float, right: float
) -> tuple[tuple[float, float], bool]:
    """The place down/2 rows and right/2 columns from a pixel, between the four about it, if all are alike."""
    rows, columns = planes.shape
    p = min(max(i + (1 if down > 0.0 else -1), 0), rows - 1)
    q = min(max(j + (1 if right > 0.0 else -1), 0), columns - 1)
    t, w = 0.5 * abs(down), 0.5 * abs(right)
    u = v = 0.0
    for row, share_row in ((i, 1.0 - t), (p, t)):
        for column, share_column in ((j, 1.0 - w), (q, w)):
            share = share_row * share_column
            if share > 0.0:
                if planes[row, column] != planes[i, j] or crossed[row, column] != crossed[i, j]:
                    return (u, v), False
                u += share * places[row, column, 0]
                v += share * places[row, column, 1]
    return (u, v), planes[i, j] >= 0


@kernel(inline="always")
def _alike_around(
    backdrop: Backdrop, planes: Planes, places: Floats, crossed: Crossed, i: int, j: int
) -> bool:
    """Whether the pixel and its neighbours all end in one square of a pattern of squares."""
    plane = planes[i, j]
    if plane < 0:
        return True
    if backdrop.tables[plane, 3]:
        return False
    rows, columns = planes.shape
    low_u = low_v = np.inf
    high_u = high_v = -np.inf
    for p in range(max(i - 1, 0), min(i + 2, rows)):
        for q in range(max(j - 1, 0), min(j + 2, columns)):
            if planes[p, q] == plane and crossed[p, q] == crossed[i, j]:
                low_u, high_u = min(low_u, places[p, q, 0]), max(high_u, places[p, q, 0])
                low_v, high_v = min(low_v, places[p, q, 1]), max(high_v, places[p, q, 1])
    across = backdrop.repeats[plane] * backdrop.tables[plane, 2]
    below = backdrop.repeats[plane] * backdrop.tables[plane, 1]
    return bool(
        np.floor((low_u + 0.5) * across) == np.floor((high_u + 0.5) * across)
        and np.floor((low_v + 0.5) * below) == np.floor((high_v + 0.5) * below)
    )


def averaged(image: Colours, times: int) -> Colours:
    """Means of times × times samples, the low-pass of real supersampling.

    Args:
        image: (times·rows, times·columns, 3).
        times: samples a pixel along each axis.

    Returns:
        (rows, columns, 3).
    """
    rows, columns = image.shape[0] // times, image.shape[1] // times
    samples = image.reshape(rows, times, columns, times, 3)
    return np.asarray(samples.mean(axis=(1, 3)) + 0.5, dtype=np.uint8)

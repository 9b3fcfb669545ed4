"""Travel times from elements to every pixel: factored Eikonal solutions, read by cubic splines."""

import math
from typing import NamedTuple

import numpy as np

from ...arrays import Float32s, Floats, Ints
from ...compilation.compiled import kernel
from ...eikonal import solve
from ...splines.cubic import coefficients, jet_2d


class ElementTimes(NamedTuple):
    """Times between some elements and every point, on the nodes of the speed.

    Divided by the distance from the element they are smooth there, so that a spline may read them between
    nodes (T = |x - element| · τ; dissertation, section 6.2).

    Attributes:
        place: (k, 2), elements, nodes.
        slowness: (k, nx + 3, ny + 3), spline of τ, the mean slowness along the ray, s/m, float32.
    """

    place: Floats
    slowness: Float32s


def solve_times(speed: Floats, spacing: float, elements: Floats) -> ElementTimes:
    """Times of some elements.

    Args:
        speed: (nx, ny), m/s.
        spacing: node spacing, m.
        elements: (k, 2), m, node 0 at 0, inside the grid.

    Raises:
        InvalidInput: as ``eikonal.solve``.
    """
    splines = np.empty((len(elements), *(n + 3 for n in speed.shape)), dtype=np.float32)
    nodes = np.stack(np.meshgrid(*map(np.arange, speed.shape), indexing="ij"), axis=-1) * spacing
    for k, element in enumerate(elements):
        distance = np.linalg.norm(nodes - element, axis=-1)
        near = distance < 1e-6 * spacing
        distance[near] = 1.0
        time = solve(speed, spacing, element)
        splines[k] = coefficients(np.where(near, 1.0 / speed, time / distance))
    return ElementTimes(elements / spacing, splines)


def joined(times: list[ElementTimes]) -> ElementTimes:
    """Those of several groups of elements, in their order."""
    return ElementTimes(*(np.concatenate(arrays) for arrays in zip(*times, strict=True)))


@kernel
def times_between(times: ElementTimes, spacing: float, others: Floats) -> Floats:
    """Time from each element to each of others, (k, n), s.

    Args:
        times: of the first.
        spacing: of its nodes, m.
        others: (n, 2), nodes.
    """
    found = np.empty((len(times.place), len(others)))
    for k in range(len(times.place)):
        for n in range(len(others)):
            x, y = others[n, 0] - times.place[k, 0], others[n, 1] - times.place[k, 1]
            slowness = jet_2d(times.slowness[k], others[n, 0], others[n, 1])[0]
            found[k, n] = spacing * math.sqrt(x * x + y * y) * slowness
    return found


class Views(NamedTuple):
    """Some pixels as seen from some elements, each (k, pixels), float32.

    Attributes:
        time: T(element, pixel), s.
        x, y: direction of the ray at the pixel, ∇T/|∇T|.
    """

    time: Float32s
    x: Float32s
    y: Float32s


@kernel(inline="always")
def view_pixels(
    times: ElementTimes,
    which: Ints,
    spacing: float,
    px: Floats,
    py: Floats,
    count: int,
    views: Views,
) -> None:
    """Times and directions of some elements at the first ``count`` pixels.

    Args:
        times: of the elements.
        which: (k,), indices of those that are viewed.
        spacing: of the nodes, m.
        px, py: of the pixels, nodes.
        views: written.
    """
    for n in range(len(which)):
        k = which[n]
        spline = times.slowness[k]
        for p in range(count):
            x, y = px[p] - times.place[k, 0], py[p] - times.place[k, 1]
            distance = math.sqrt(x * x + y * y)
            slowness, in_x, in_y, _, _, _ = jet_2d(spline, px[p], py[p])
            # ∇T = τ ∇d + d ∇τ; its length is the slowness there.
            gx, gy = slowness * x / distance + distance * in_x, slowness * y / distance + distance * in_y
            length = math.sqrt(gx * gx + gy * gy)
            views.time[n, p] = spacing * distance * slowness
            views.x[n, p] = gx / length
            views.y[n, p] = gy / length

"""Height fields of warped backdrops, and their exact intersection with rays.

Section 4.3.3 of the dissertation has a planar backdrop and names others as an extension "by ways of a warping
procedure": a ray is intersected with the height field, and its place on the flat rectangle below is coloured
and supersampled as on a plane.
"""

import math

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel

# Most cells of the height field on the way of a ray; a ray almost along an endless backdrop passes more.
MAX_CELLS = 1 << 16

# Distance along the ray, ∞ for none; u and v.
Place = tuple[float, float, float]


@kernel
def meet_relief(
    heights: Floats,
    endless: bool,
    start: tuple[float, float, float],
    along: tuple[float, float, float],
    lowest: float,
    highest: float,
    nearest: float,
) -> Place:
    """The first intersection of a ray with a bilinear height field.

    In a cell the height above the ray is a polynomial of second degree in the distance: its root is exact.

    Args:
        heights: (rows, columns) at nodes from edge to edge of the rectangle, m, continued by mirroring.
        endless: whether it continues beyond the rectangle.
        start: u and v, −½ to ½ in the rectangle, and the height over it, m, at distance 0.
        along: their change per unit of distance.
        lowest, highest: of the heights, m.
        nearest: distances from here on are not looked for.
    """
    none = (np.inf, np.nan, np.nan)
    rows, columns = heights.shape
    near, far = 0.0, nearest
    for axis in range(3):
        low, high = (lowest, highest) if axis == 2 else (-0.5, 0.5)
        if axis < 2 and endless:
            continue
        if along[axis] == 0.0:
            if not low <= start[axis] <= high:
                return none
            continue
        a, b = (low - start[axis]) / along[axis], (high - start[axis]) / along[axis]
        near, far = max(near, min(a, b)), min(far, max(a, b))
    if not near <= far or math.isinf(near):
        return none
    dx, dy, dz = along[0] * (columns - 1), along[1] * (rows - 1), along[2]
    s = near
    x, y = (start[0] + s * along[0] + 0.5) * (columns - 1), (start[1] + s * along[1] + 0.5) * (rows - 1)
    j, i = math.floor(x), math.floor(y)
    for _ in range(MAX_CELLS):
        x, y = (start[0] + s * along[0] + 0.5) * (columns - 1), (start[1] + s * along[1] + 0.5) * (rows - 1)
        across = _to_next_line(x, j, dx)
        down = _to_next_line(y, i, dy)
        step = max(min(across, down, far - s), 0.0)
        if math.isinf(step):
            return none
        a, b, z = x - j, y - i, start[2] + s * dz
        i0, i1, j0, j1 = (
            _mirrored(i, rows),
            _mirrored(i + 1, rows),
            _mirrored(j, columns),
            _mirrored(j + 1, columns),
        )
        h = heights[i0, j0]
        p, q = heights[i0, j1] - h, heights[i1, j0] - h
        r = heights[i1, j1] - h - p - q
        t = _first_root(
            z - (h + p * a + q * b + r * a * b),
            dz - p * dx - q * dy - r * (a * dy + b * dx),
            -r * dx * dy,
            step,
        )
        if t >= 0.0:
            s += t
            return s, start[0] + s * along[0], start[1] + s * along[1]
        if s + step >= far:
            return none
        s += step
        if across <= down:
            j += 1 if dx > 0.0 else -1
        else:
            i += 1 if dy > 0.0 else -1
    return none


@kernel(inline="always")
def _to_next_line(place: float, cell: int, speed: float) -> float:
    """Distance to the side of a cell towards which the ray runs."""
    if speed == 0.0:
        return np.inf
    return (cell + (1.0 if speed > 0.0 else 0.0) - place) / speed


@kernel(inline="always")
def _mirrored(index: int, count: int) -> int:
    """A node beyond the rectangle is one within."""
    k = index % (2 * (count - 1))
    return k if k < count else 2 * (count - 1) - k


@kernel(inline="always")
def _first_root(c: float, b: float, a: float, end: float) -> float:
    """Least root of a·t² + b·t + c in [0, end]; −1 for none."""
    if c == 0.0:
        return 0.0
    last = c + end * (b + end * a)
    if c * last > 0.0:
        # Both ends on one side: two roots, or none.
        turn = -0.5 * b / a if a != 0.0 else -1.0
        if not 0.0 < turn < end or c * (c + 0.5 * turn * b) > 0.0:
            return -1.0
    square = max(b * b - 4.0 * a * c, 0.0)
    # Without cancellation: one root by the formula, the other by the product of both.
    sum_ = -0.5 * (b + math.copysign(math.sqrt(square), b))
    first = c / sum_ if sum_ != 0.0 else np.inf
    second = sum_ / a if a != 0.0 else np.inf
    low, high = min(first, second), max(first, second)
    slack = 1e-9 * end
    if low >= -slack and low <= end + slack:
        return min(max(low, 0.0), end)
    return min(max(high, 0.0), end)

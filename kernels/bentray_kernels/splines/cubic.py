"""Interpolating cubic B-spline of a grid, with the derivatives for ray bending."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..compilation.compiled import kernel
from .prefilter import prefilter

# Nodes added by mirroring before the first and after the last one, so that every point has four.
BEFORE, AFTER = 1, 2


def coefficients(values: ArrayLike) -> Floats:
    """B-spline coefficients of a grid, mirrored at its boundary, with a border for the jets.

    Args:
        values: (nx, ny[, nz]), any unit.

    Returns:
        (nx + 3, ny + 3[, nz + 3]), C order; node 0 lies at index 1.
    """
    # numpy mirrors a single node onto itself.
    return np.ascontiguousarray(np.pad(prefilter(values, 3), (BEFORE, AFTER), mode="reflect"))


def refined(values: ArrayLike, times: int) -> Floats:
    """The interpolating spline of a grid on one that is ``times`` as fine and has the same outer nodes.

    Args:
        values: (nx, ny[, nz]), any unit.
        times: at least 1.

    Returns:
        (times·(nx − 1) + 1, …), in which every ``times``-th node keeps its value to rounding.
    """
    fine = coefficients(values)
    for axis in range(fine.ndim):
        n = fine.shape[axis] - BEFORE - AFTER
        lines = np.moveaxis(fine, axis, 0)
        read = np.empty((times * (n - 1) + 1, *lines.shape[1:]))
        for part in range(times):
            places = n if part == 0 else n - 1
            # The function itself: Python cannot call what is inlined without compiling it once more.
            weights = _weights.py_func(part / times)  # type: ignore[attr-defined]
            read[part::times] = sum(weights[q] * lines[q : q + places] for q in range(4))
        fine = np.moveaxis(read, 0, axis)
    return np.ascontiguousarray(fine)


@kernel(inline="always")
def _weights(t: float) -> tuple[float, float, float, float]:
    """Weights of the four nodes around a point, ``t`` of a cell after the second."""
    u = 1.0 - t
    return (
        u * u * u / 6.0,
        2.0 / 3.0 - 0.5 * t * t * (2.0 - t),
        2.0 / 3.0 - 0.5 * u * u * (2.0 - u),
        t * t * t / 6.0,
    )


@kernel(inline="always")
def _slopes(t: float) -> tuple[float, float, float, float]:
    u = 1.0 - t
    return -0.5 * u * u, t * (1.5 * t - 2.0), u * (2.0 - 1.5 * u), 0.5 * t * t


@kernel(inline="always")
def _bends(t: float) -> tuple[float, float, float, float]:
    u = 1.0 - t
    return u, 3.0 * t - 2.0, 3.0 * u - 2.0, t


@kernel(inline="always")
def _cell(place: float, stored: int) -> int:
    """Index of the first of the four coefficients around a position, nodes."""
    return min(max(int(place), 0), stored - BEFORE - AFTER - 1)


@kernel(inline="always")
def jet_2d(spline: Floats, x: float, y: float) -> tuple[float, float, float, float, float, float]:
    """Value, x and y slope, and xx, xy, yy second derivative at a point, in nodes."""
    i, j = _cell(x, spline.shape[0]), _cell(y, spline.shape[1])
    wx, dx, bx = _weights(x - i), _slopes(x - i), _bends(x - i)
    wy, dy, by = _weights(y - j), _slopes(y - j), _bends(y - j)
    value = slope_x = slope_y = xx = xy = yy = 0.0
    for p in range(4):
        level = slope = bend = 0.0
        for q in range(4):
            c = spline[i + p, j + q]
            level += wy[q] * c
            slope += dy[q] * c
            bend += by[q] * c
        value += wx[p] * level
        slope_x += dx[p] * level
        xx += bx[p] * level
        slope_y += wx[p] * slope
        xy += dx[p] * slope
        yy += wx[p] * bend
    return value, slope_x, slope_y, xx, xy, yy


@kernel(inline="always")
def jet_3d(
    spline: Floats, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Value, the slopes, and xx, xy, xz, yy, yz, zz second derivative at a point, in nodes."""
    i, j, k = _cell(x, spline.shape[0]), _cell(y, spline.shape[1]), _cell(z, spline.shape[2])
    wx, dx, bx = _weights(x - i), _slopes(x - i), _bends(x - i)
    wy, dy, by = _weights(y - j), _slopes(y - j), _bends(y - j)
    wz, dz, bz = _weights(z - k), _slopes(z - k), _bends(z - k)
    value = slope_x = slope_y = slope_z = xx = xy = xz = yy = yz = zz = 0.0
    for p in range(4):
        level = in_y = in_z = in_yy = in_yz = in_zz = 0.0
        for q in range(4):
            line = slope = bend = 0.0
            for r in range(4):
                c = spline[i + p, j + q, k + r]
                line += wz[r] * c
                slope += dz[r] * c
                bend += bz[r] * c
            level += wy[q] * line
            in_y += dy[q] * line
            in_yy += by[q] * line
            in_z += wy[q] * slope
            in_yz += dy[q] * slope
            in_zz += wy[q] * bend
        value += wx[p] * level
        slope_x += dx[p] * level
        xx += bx[p] * level
        slope_y += wx[p] * in_y
        xy += dx[p] * in_y
        slope_z += wx[p] * in_z
        xz += dx[p] * in_z
        yy += wx[p] * in_yy
        yz += wx[p] * in_yz
        zz += wx[p] * in_zz
    return value, slope_x, slope_y, slope_z, xx, xy, xz, yy, yz, zz

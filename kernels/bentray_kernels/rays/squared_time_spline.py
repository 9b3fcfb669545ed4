"""B-spline of the squared travel time, whose gradient guides rays between the nodes (chapter 6.3)."""

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel
from ..splines import coefficients
from ..splines.cubic import jet_2d, jet_3d

# Nodes added beyond each face before the filter, which mirrors: its zero slope at the face falls by a factor
# of 3.7 a node.
BEYOND = 16


def squared_time_spline(times: Floats) -> Floats:
    """Coefficients of the interpolating cubic B-spline of T².

    T² is continued beyond the grid by the parabola through the last three nodes, so that the spline of a
    paraboloid, the T² of a homogeneous medium, is that paraboloid up to the faces.

    Args:
        times: (nx, ny[, nz]), s.

    Returns:
        (nx + 3, ny + 3[, nz + 3]), s², as ``splines.coefficients``.
    """
    squared = times * times
    for axis in range(times.ndim):
        squared = _continued(squared, axis)
    spline = coefficients(squared)
    inner = tuple(slice(BEYOND, BEYOND + n + 3) if n > 1 else slice(None) for n in times.shape)
    return np.ascontiguousarray(spline[inner])


def _continued(values: Floats, axis: int) -> Floats:
    """Nodes beyond both ends of an axis, by the polynomial through up to three nodes; for one node none."""
    lines = np.moveaxis(values, axis, 0)
    n = len(lines)
    if n == 1:
        return values
    steps = np.arange(BEYOND, 0, -1.0).reshape(-1, *(1,) * (lines.ndim - 1))
    ends = []
    for end in (lines, lines[::-1]):
        slope = end[1] - end[0]
        bend = end[2] - 2.0 * end[1] + end[0] if n > 2 else 0.0
        # At −k, by Newton's forward differences.
        ends.append(end[0] - steps * slope + 0.5 * steps * (steps + 1.0) * bend)
    return np.moveaxis(np.concatenate((ends[0], lines, ends[1][::-1])), 0, axis)


@kernel(inline="always")
def spline_slope(spline: Floats, shape: tuple[int, ...], point: Floats, slope: Floats) -> None:
    """∇(T²) at a point, s² per node.

    Args:
        spline: ``squared_time_spline``.
        shape: of the grid.
        point: (ndim,), nodes.
        slope: (ndim,), filled.
    """
    if len(shape) == 2:
        _, slope[0], slope[1], _, _, _ = jet_2d(spline, point[0], point[1])
    else:
        _, slope[0], slope[1], slope[2], _, _, _, _, _, _ = jet_3d(spline, point[0], point[1], point[2])

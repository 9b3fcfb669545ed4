"""Paths of the rays of one source."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from ..requests.names import RayGradient
from .descent import STEP, empty_path, trace_ray
from .fan import Fan, RayKind


def trace(
    tof: ArrayLike,
    spacing: float,
    receivers: ArrayLike,
    source: ArrayLike,
    *,
    kind: RayKind = "curved",
    gradient: RayGradient = "differences",
) -> list[Floats]:
    """Rays from every receiver back to the source, down the gradient of the travel time (chapter 6.2.2).

    Every ray arrives; no ray linking is needed. In a homogeneous medium the paths
    are straight to rounding: T² is a paraboloid, for which central differences and splines are exact.

    Args:
        tof: (nx, ny[, nz]), s, as ``eikonal.solve`` gives it; straight rays use its shape alone.
        spacing: node spacing, m.
        receivers: (k, ndim), m, in the grid; node 0 lies at 0.
        source: (ndim,), m, where ``tof`` is 0.
        kind: ``curved`` or ``straight``.
        gradient: of curved rays, ``differences``: central ones at the nodes, interpolated between them; or
            ``bspline``: that of the cubic B-spline of T² (chapter 6.3). Behind shocks the spline swings.

    Returns:
        k paths, each (points, ndim), m, from the receiver to the source.

    Raises:
        InvalidInput: naming the argument: shapes, travel times that are not finite, points outside the grid.
    """
    fan = Fan.checked(tof, spacing, receivers, source, kind, gradient)
    points, counts = _trace_all(fan)
    return np.split(points * spacing, np.cumsum(counts)[:-1]) if len(counts) else []


@kernel
def _trace_all(fan: Fan) -> tuple[Floats, Ints]:
    """Points of all paths one after the other, (points, ndim), nodes, and the length of each path."""
    path, scratch = empty_path(fan)
    rays, axes = fan.receivers.shape
    counts = np.empty(rays, np.int64)
    points = np.empty((rays * max(16, sum(fan.shape) // 2), axes))
    filled = 0
    for k in range(rays):
        count = trace_ray(fan, k, STEP, path, scratch)
        while filled + count > len(points):
            points = np.concatenate((points, np.empty_like(points)))
        points[filled : filled + count] = path[:count]
        filled += count
        counts[k] = count
    return points[:filled], counts

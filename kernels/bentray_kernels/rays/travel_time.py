"""Travel times as integrals of the slowness along bent rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..compilation.compiled import kernel
from ..eikonal.problem import SlownessGrid
from ..errors import InvalidInput
from ..splines import coefficients
from .bending import STRIDE, bend
from .descent import empty_path, trace_curved
from .fan import Fan
from .newton_step import allocate_bending


def travel_times(
    tof: ArrayLike, speed: ArrayLike, spacing: float, receivers: ArrayLike, source: ArrayLike
) -> Floats:
    """Travel times to receivers, several times as accurate as the grid travel time that guides the rays.

    Each ray is traced as by ``trace`` and then bent until its time is stationary (Fermat), in the cubic
    spline of the logarithm of the slowness. ``tof`` only has to lead to the right local minimum. In smooth
    media the error falls with about the third to fourth power of the spacing, near the boundary, where the
    spline is mirrored, with the second. Where the speed jumps by factors of four and more between nodes, a
    spline does not represent the medium, and the time is no better than that of the grid.

    Args:
        tof: (nx, ny[, nz]), s, as ``eikonal.solve`` gives it for ``source``.
        speed: as ``tof``, m/s.
        spacing: node spacing, m.
        receivers: (k, ndim), m, in the grid; node 0 lies at 0.
        source: (ndim,), m.

    Returns:
        (k,), s.

    Raises:
        InvalidInput: as ``trace``, and for speeds that are not of the shape of ``tof``, finite and > 0.
    """
    fan = Fan.checked(tof, spacing, receivers, source, "curved")
    return np.asarray(_bent_times(fan, log_slowness(fan, speed, spacing)) * spacing)


def log_slowness(fan: Fan, speed: ArrayLike, spacing: float) -> Floats:
    """Spline coefficients of the logarithm of the slowness, in which the rays of a fan are bent.

    Raises:
        InvalidInput: see ``travel_times``.
    """
    if np.shape(speed) != fan.shape:
        raise InvalidInput("speed", f"shape {np.shape(speed)}", f"the shape of tof, {fan.shape}")
    return coefficients(np.log(SlownessGrid.checked(speed, spacing).slowness))


@kernel
def _bent_times(fan: Fan, spline: Floats) -> Floats:
    """Times for a spacing of 1, (k,)."""
    path, scratch = empty_path(fan)
    space = allocate_bending(len(path), fan.shape)
    times = np.empty(len(fan.receivers))
    for k in range(len(times)):
        count = trace_curved(fan, k, STRIDE, path, scratch)
        times[k], _ = bend(path, count, spline, fan.shape, space)
    return times

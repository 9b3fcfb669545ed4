"""Travel times read as the integral of the slowness along bent rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..compiled import kernel
from ..eikonal.problem import Medium
from ..errors import InvalidInput
from ..splines import coefficients
from .bending import STRIDE, bend, bending
from .descent import empty_path, trace_curved
from .fan import Fan


def travel_times(
    tof: ArrayLike, speed: ArrayLike, spacing: float, receivers: ArrayLike, source: ArrayLike
) -> Floats:
    """Travel times to receivers, several times as accurate as those of the grid that guides the rays.

    Each ray is traced down ``tof`` as by ``trace`` and then bent until its time is stationary (Fermat), in
    the cubic spline through the logarithm of the slowness. The error of ``tof`` counts only in that it must
    lead each ray to the right valley. Where the medium is smooth the error falls with about the third to
    fourth power of the spacing; rays near the rim, where the spline is mirrored, keep the second. From node
    to node by factors of four and more, no spline is a good guess at the medium, and no better time is given.

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
    """Spline coefficients of the logarithm of the slowness that a fan's rays are bent in.

    Raises:
        InvalidInput: see ``travel_times``.
    """
    if np.shape(speed) != fan.shape:
        raise InvalidInput("speed", f"shape {np.shape(speed)}", f"the shape of tof, {fan.shape}")
    return coefficients(np.log(Medium.checked(speed, spacing).slowness))


@kernel
def _bent_times(fan: Fan, spline: Floats) -> Floats:
    """Times for a spacing of 1, (k,)."""
    path, scratch = empty_path(fan)
    space = bending(len(path), fan.shape)
    times = np.empty(len(fan.receivers))
    for k in range(len(times)):
        count = trace_curved(fan, k, STRIDE, path, scratch)
        times[k], _ = bend(path, count, spline, fan.shape, space)
    return times

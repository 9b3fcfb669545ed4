"""Paths of the rays of one source, as points."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..compiled import kernel
from .descent import STEP, curved_ray, straight_ray
from .fan import Fan, Kind


def trace(
    tof: ArrayLike, spacing: float, receivers: ArrayLike, source: ArrayLike, *, kind: Kind = "curved"
) -> list[Floats]:
    """Rays from every receiver back to the source, down the gradient of the travel time (chapter 6.2.2).

    Every ray arrives: there is no ray linking and none is lost. In a homogeneous medium the paths
    are straight to rounding, since T² is then a paraboloid, which central differences take exactly.

    Args:
        tof: (nx, ny[, nz]), s, as ``eikonal.solve`` gives it; straight rays use its shape alone.
        spacing: node spacing, m.
        receivers: (k, ndim), m, in the grid; node 0 lies at 0.
        source: (ndim,), m, where ``tof`` is 0.
        kind: ``curved`` or ``straight``.

    Returns:
        k paths, each (points, ndim), m, from the receiver to the source.

    Raises:
        InvalidInput: naming the argument: shapes, travel times that are not finite, points outside the grid.
    """
    fan = Fan.checked(tof, spacing, receivers, source, kind)
    path = np.empty((fan.room, len(fan.shape)))
    scratch = np.empty((3, len(fan.shape)))
    paths = []
    for receiver in fan.receivers:
        count = _one(
            receiver, fan.source, fan.tof, fan.gradient, fan.shape, fan.strides, fan.curved, path, scratch
        )
        paths.append(path[:count] * spacing)
    return paths


@kernel
def _one(
    receiver: Floats,
    source: Floats,
    tof: Floats,
    gradient: Floats,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    curved: bool,
    path: Floats,
    scratch: Floats,
) -> int:
    if curved:
        return curved_ray(receiver, source, tof, gradient, shape, strides, STEP, path, scratch)
    return straight_ray(receiver, source, len(shape), path)

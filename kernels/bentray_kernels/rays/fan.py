"""All rays of one source: what is traced, checked and brought into node units once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats
from ..errors import InvalidInput
from .descent import STEP, squared_gradient

Kind = Literal["curved", "straight"]

# A ray longer than this many times the straight way round the grid has left the physics behind.
LONGEST = 4


@dataclass(frozen=True)
class Fan:
    """The rays from every receiver to one source, ready for the kernels; positions in nodes.

    Attributes:
        tof: flat travel time, s.
        gradient: (nodes, ndim) ∇(T²) for curved rays, empty for straight ones.
        shape, strides: of the grid, one entry an axis.
        receivers: (k, ndim); source: (ndim,).
    """

    tof: Floats
    gradient: Floats
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    receivers: Floats
    source: Floats
    curved: bool

    @classmethod
    def checked(
        cls, tof: ArrayLike, spacing: float, receivers: ArrayLike, source: ArrayLike, kind: Kind
    ) -> Fan:
        """The fan of ``trace``.

        Raises:
            InvalidInput: see ``bentray_kernels.rays.trace``.
        """
        times = np.ascontiguousarray(tof, dtype=np.float64)
        if times.ndim not in (2, 3) or times.size == 0:
            raise InvalidInput("tof", f"shape {times.shape}", "a non-empty 2-D or 3-D array")
        if not np.isfinite(times).all():
            place = tuple(int(i) for i in np.argwhere(~np.isfinite(times))[0])
            raise InvalidInput("tof", f"{times[place]} at node {place}", "finite travel times in seconds")
        step = float(spacing)
        if not (math.isfinite(step) and step > 0.0):
            raise InvalidInput("spacing", spacing, "a finite node spacing > 0 m")
        if kind not in ("curved", "straight"):
            raise InvalidInput("kind", repr(kind), "curved or straight")
        points = np.asarray(receivers, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != times.ndim:
            raise InvalidInput("receivers", f"shape {points.shape}", f"(receivers, {times.ndim})")
        start = np.asarray(source, dtype=np.float64)
        if start.shape != (times.ndim,):
            raise InvalidInput("source", f"shape {start.shape}", f"{times.ndim} coordinates in metres")
        last = np.array(times.shape) - 1.0
        nodes = _inside("receivers", points / step, last, step)
        origin = _inside("source", start[None, :] / step, last, step)[0]
        strides = tuple(int(math.prod(times.shape[axis + 1 :])) for axis in range(times.ndim))
        curved = kind == "curved"
        flat = times.ravel()
        gradient = squared_gradient(flat, times.shape, strides) if curved else np.empty((0, times.ndim))
        return cls(flat, gradient, times.shape, strides, nodes, origin, curved)

    @property
    def room(self) -> int:
        """Points that no ray of this grid needs more than."""
        return int(LONGEST * sum(self.shape) / STEP) + 16


def _inside(name: str, points: Floats, last: Floats, spacing: float) -> Floats:
    """Points in nodes, rounding at the rim forgiven; anything farther out is refused."""
    bad = ~(np.isfinite(points) & (points >= -1e-9) & (points <= last + 1e-9)).all(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        extent = (last * spacing).tolist()
        raise InvalidInput(
            name, f"{(points[first] * spacing).tolist()} (number {first})", f"points from 0 to {extent} m"
        )
    return np.clip(points, 0.0, last)

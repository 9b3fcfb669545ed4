"""All rays of one source: arguments of the ray kernels, checked and converted to node units."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, refuse_mask
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from ..requests.names import RayGradient
from .squared_time_spline import squared_time_spline

RayKind = Literal["curved", "straight"]


class Fan(NamedTuple):
    """The rays from every receiver to one source, the first argument of the ray kernels; positions in nodes.

    Attributes:
        receivers: (k, ndim); source: (ndim,).
        tof: flat travel time, s.
        gradient: (nodes, ndim) ∇(T²) for curved rays by differences, else empty.
        spline: ``squared_time_spline`` for curved rays by B-splines, else empty; of ndim axes.
        shape, strides: of the grid; tuples, so that the compiler unrolls the loops over axes.
        curved: whether the rays follow the gradient.
    """

    receivers: Floats
    source: Floats
    tof: Floats
    gradient: Floats
    spline: Floats
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    curved: bool

    @classmethod
    def checked(
        cls,
        tof: ArrayLike,
        spacing: float,
        receivers: ArrayLike,
        source: ArrayLike,
        kind: RayKind,
        gradient: RayGradient = "differences",
    ) -> Fan:
        """The fan for the arguments of ``trace``.

        Raises:
            InvalidInput: see ``bentray_kernels.rays.trace``.
        """
        for name, array in (("tof", tof), ("receivers", receivers), ("source", source)):
            refuse_mask(name, array)
        times = np.ascontiguousarray(tof, dtype=np.float64)
        if times.ndim not in (2, 3) or times.size == 0:
            raise InvalidInput("tof", f"shape {times.shape}", "a non-empty 2-D or 3-D array")
        if not np.isfinite(times).all():
            node = tuple(int(i) for i in np.argwhere(~np.isfinite(times))[0])
            raise InvalidInput("tof", f"{times[node]} at node {node}", "finite travel times in seconds")
        step = float(spacing)
        if not (math.isfinite(step) and step > 0.0):
            raise InvalidInput("spacing", spacing, "a finite node spacing > 0 m")
        if kind not in ("curved", "straight"):
            raise InvalidInput("kind", repr(kind), "curved or straight")
        if gradient not in ("differences", "bspline"):
            raise InvalidInput("gradient", repr(gradient), "differences or bspline")
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
        slopes, spline = np.empty((0, times.ndim)), np.empty((0,) * times.ndim)
        if curved and gradient == "differences":
            slopes = squared_gradient(flat, times.shape, strides)
        elif curved:
            spline = squared_time_spline(times)
        return cls(nodes, origin, flat, slopes, spline, times.shape, strides, curved)


@kernel
def squared_gradient(tof: Floats, shape: tuple[int, ...], strides: tuple[int, ...]) -> Floats:
    """∇(T²) at the nodes, (nodes, ndim): central differences, one-sided of second order at the boundary."""
    squared = tof * tof
    axes = len(shape)
    gradient = np.zeros((tof.size, axes))
    for node in range(tof.size):
        rest = node
        for axis in range(axes):
            stride = strides[axis]
            n = shape[axis]
            if n == 1:
                continue
            i = rest // stride
            rest = rest % stride
            if n == 2:
                low = node - i * stride
                gradient[node, axis] = squared[low + stride] - squared[low]
            elif i == 0:
                gradient[node, axis] = (
                    -1.5 * squared[node] + 2.0 * squared[node + stride] - 0.5 * squared[node + 2 * stride]
                )
            elif i == n - 1:
                gradient[node, axis] = (
                    1.5 * squared[node] - 2.0 * squared[node - stride] + 0.5 * squared[node - 2 * stride]
                )
            else:
                gradient[node, axis] = 0.5 * (squared[node + stride] - squared[node - stride])
    return gradient


def _inside(name: str, points: Floats, last: Floats, spacing: float) -> Floats:
    """Points in nodes, clipped to the grid within rounding.

    Raises:
        InvalidInput: naming the first point outside.
    """
    bad = ~(np.isfinite(points) & (points >= -1e-9) & (points <= last + 1e-9)).all(axis=1)
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        extent = (last * spacing).tolist()
        raise InvalidInput(
            name, f"{(points[first] * spacing).tolist()} (number {first})", f"points from 0 to {extent} m"
        )
    return np.clip(points, 0.0, last)

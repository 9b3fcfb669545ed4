"""Interpolation of a grid by any filter: value and gradient at many points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.cpython.unsafe.tuple import tuple_setitem
from numpy.typing import ArrayLike, DTypeLike

from ..arrays import Floats, refuse_mask
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from .filters import Filter, bspline, filter_of
from .prefilter import prefilter as coefficients_of
from .sampling import Stencil, border_of, lies_within, stencil_of, value_and_gradient_at, value_at


class Spline:
    """A field between and beyond the nodes of a grid.

    Places are in nodes, gradients per node: for metres, divide a place by the spacing before and the gradient
    after. Off the grid the field is mirrored at its outer nodes, as by scipy's mode "mirror"; at NaN it is
    NaN.

    Args:
        volume: (x[, y[, z]]), at least two nodes along each axis, finite, any unit.
        order: of the B-spline, 2 to 6.
        prefilter: whether the spline passes through the nodes; else the nodes are its coefficients, which
            blurs it (dissertation, 3.3.2).
        smoothing: λ as in ``prefilter.prefilter``, for prefiltered splines.
        dtype: of the coefficients and of the sums, float64 or float32; places stay in float64.

    Attributes:
        shape: of the volume.
        filter: what is read.
        coefficients: C order, with ``pad`` nodes before and, with them, taps − 1 or taps − 2 more than the
            volume along each axis.
        pad: index of node 0.
        stencil: the filter for ``sampling.value_at`` and ``value_and_gradient_at``.

    Raises:
        InvalidInput: for another shape, a value that is not finite, another order, smoothing or type, and for
            smoothing without a prefilter.
    """

    def __init__(
        self,
        volume: ArrayLike,
        order: int = 3,
        prefilter: bool = True,
        smoothing: float = 0.0,
        dtype: DTypeLike = np.float64,
    ) -> None:
        if order not in range(2, 7):
            raise InvalidInput("order", order, "a whole number from 2 to 6")
        self._read(volume, bspline(int(order)), prefilter, smoothing, dtype)

    @classmethod
    def from_volume(
        cls,
        volume: ArrayLike,
        filter: str,  # noqa: A002 - the word of the field
        prefilter: bool = True,
        smoothing: float = 0.0,
        dtype: DTypeLike = np.float64,
    ) -> Spline:
        """A spline of a volume by any filter of ``filters.FILTERS``, by name.

        Args:
            volume, prefilter, smoothing, dtype: as above. Filters that are no B-spline pass through the nodes
                as they are and take no smoothing.
            filter: as ``"bspline3"``, ``"catmull-rom"``.

        Raises:
            InvalidInput: also for an unknown filter.
        """
        spline = cls.__new__(cls)
        spline._read(volume, filter_of(filter), prefilter, smoothing, dtype)
        return spline

    def _read(
        self, volume: ArrayLike, read: Filter, prefilter: bool, smoothing: float, dtype: DTypeLike
    ) -> None:
        kind = _type_of(dtype)
        nodes = _checked(volume)
        if read.order and prefilter:
            nodes = coefficients_of(nodes, read.order, smoothing)
        elif smoothing != 0.0:
            raise InvalidInput("smoothing", smoothing, "0 for filters that are not prefiltered")
        self.shape = nodes.shape
        self._last = tuple(n - 1.0 for n in nodes.shape)
        self.filter = read
        self.stencil: Stencil = stencil_of(read, kind)
        self.pad = border_of(read)[0]
        with np.errstate(over="ignore"):
            nodes = nodes.astype(kind)
        if not np.isfinite(nodes).all():
            raise InvalidInput("volume", "values too large to filter", f"values that {kind} can hold")
        self.coefficients: Any = np.ascontiguousarray(np.pad(nodes, border_of(read), mode="reflect"))

    def value(self, points: ArrayLike) -> Floats:
        """The field at points (m, ndim), nodes.

        Returns:
            (m,), float64.

        Raises:
            InvalidInput: for points of another shape.
        """
        positions = self.positions(points)
        values = np.empty(len(positions))
        _values(self.coefficients, self.stencil, positions, self._last, values)
        return values

    def gradient(self, points: ArrayLike) -> Floats:
        """Its gradient, per node; points as in ``value``.

        Returns:
            (m, ndim), float64.
        """
        return self.value_and_gradient(points)[1]

    def value_and_gradient(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Both at once, for little more than the price of one."""
        positions = self.positions(points)
        values, gradients = np.empty(len(positions)), np.empty(positions.shape)
        _values_and_gradients(self.coefficients, self.stencil, positions, self._last, values, gradients)
        return values, gradients

    def positions(self, points: ArrayLike) -> Floats:
        """The points as (m, ndim), float64, C order; raises InvalidInput for another shape."""
        positions = np.ascontiguousarray(points, dtype=np.float64)
        if positions.ndim != 2 or positions.shape[1] != len(self.shape):
            raise InvalidInput("points", f"shape {positions.shape}", f"shape (m, {len(self.shape)}), nodes")
        return positions


def _type_of(dtype: DTypeLike) -> np.dtype[Any]:
    accepted = "float64 or float32"
    try:
        kind = np.dtype(dtype)
    except TypeError:
        raise InvalidInput("dtype", repr(dtype), accepted) from None
    if kind not in (np.float64, np.float32):
        raise InvalidInput("dtype", kind, accepted)
    return kind


def _checked(volume: ArrayLike) -> Floats:
    refuse_mask("volume", volume)
    nodes = np.asarray(volume, dtype=np.float64)
    if nodes.ndim not in (1, 2, 3) or min(nodes.shape, default=0) < 2:
        raise InvalidInput(
            "volume", f"shape {nodes.shape}", "1 to 3 dimensions with at least two nodes along each"
        )
    if not np.isfinite(nodes).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(nodes))[0])
        raise InvalidInput("volume", f"{nodes[where]} at node {where}", "finite values")
    return nodes


@kernel
def _values(coefficients: Any, stencil: Stencil, places: Floats, last: Any, values: Floats) -> None:
    for m in range(len(places)):
        point = _point(coefficients, places, m)
        if lies_within(point, last):
            values[m] = value_at(coefficients, stencil, point)
        else:
            values[m] = _mirrored(coefficients, stencil, point, last)[0]


@kernel
def _values_and_gradients(
    coefficients: Any, stencil: Stencil, places: Floats, last: Any, values: Floats, gradients: Floats
) -> None:
    for m in range(len(places)):
        point = _point(coefficients, places, m)
        if lies_within(point, last):
            values[m], slopes = value_and_gradient_at(coefficients, stencil, point)
        else:
            values[m], slopes = _mirrored(coefficients, stencil, point, last)
        for axis, slope in enumerate(slopes):
            gradients[m, axis] = slope


@kernel(inline="always")
def _point(coefficients: Any, places: Floats, m: int) -> Any:
    if coefficients.ndim == 1:
        return (places[m, 0],)
    if coefficients.ndim == 2:
        return places[m, 0], places[m, 1]
    return places[m, 0], places[m, 1], places[m, 2]


# Not inlined, so that points on the grid do not wait for it.
@kernel
def _mirrored(coefficients: Any, stencil: Stencil, point: Any, last: Any) -> Any:
    """Value and gradient at a point off the grid: from its mirror image, with reversed slopes."""
    image, signs = point, point
    for axis, place in enumerate(point):
        turned = place - 2.0 * last[axis] * np.floor(place / (2.0 * last[axis]))
        beyond = turned > last[axis]
        image = tuple_setitem(image, axis, 2.0 * last[axis] - turned if beyond else turned)
        signs = tuple_setitem(signs, axis, -1.0 if beyond else 1.0)
    value, slopes = value_and_gradient_at(coefficients, stencil, image)
    for axis, sign in enumerate(signs):
        slopes = tuple_setitem(slopes, axis, sign * slopes[axis])
    return value, slopes

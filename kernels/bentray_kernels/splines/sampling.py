"""Value and gradient of a filtered grid at one point, for compiled code."""

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.errors import NumbaTypeError
from numba.extending import intrinsic
from numpy.typing import DTypeLike

from ..compilation.compiled import kernel
from .filters import Filter
from .lanes import (
    DOUBLE,
    FLOAT,
    INDEX,
    Axis,
    Lanes,
    axes_at,
    point_vector,
    value,
    value_and_gradient,
    width_of,
    within,
)


class Stencil(NamedTuple):
    """A filter as an argument of compiled functions.

    The number of taps must be a compile-time constant for unrolled loops. Numba compiles a kernel for each
    type of argument, and the length of a tuple is part of its type: hence ``places``. So one kernel serves
    all filters, compiled and cached once for each number of taps, for which ``lanes`` generates the vector
    instructions; a plain loop took five times as long.

    Attributes:
        places: (0, 1, …, taps − 1); only its length is used.
        shift: as ``Filter.shift``.
        weights: (taps, 2, width), C order, by power of t: of the value and of the slope, by node, 0 in the
            lanes that no node fills (``lanes.width_of``).
    """

    places: tuple[int, ...]
    shift: float
    weights: Any


def stencil_of(read: Filter, dtype: DTypeLike = np.float64) -> Stencil:
    """The stencil of a filter, for coefficients of that type; powers that it lacks have the weight 0."""
    weights = np.zeros((read.taps, 2, width_of(read.taps)), dtype)
    for which, matrix in enumerate((read.value, read.slope)):
        weights[: matrix.shape[1], which, : read.taps] = matrix.T
    return Stencil(tuple(range(read.taps)), read.shift, weights)


def border_of(read: Filter) -> tuple[int, int]:
    """Nodes to add before the first and after the last one, so that every point has all its taps."""
    # A point on the last node belongs to the cell before it, unless cells are centred on nodes.
    return read.before, read.taps - 1 - read.before - (0 if read.shift else 1)


@kernel(inline="always")
def value_at(coefficients: Any, stencil: Stencil, point: Any) -> Any:
    """The filtered value at one point.

    Args:
        coefficients: (x[, y[, z]]), C order, float64 or float32, with the border of ``border_of``.
        stencil: of the filter, in the same type; the sums are in it too.
        point: (x[, y[, z]]), a tuple of floats, nodes; node 0 is the first one inside the border. Off the
            grid the polynomial of the outermost cell is continued; NaN gives NaN.

    Returns:
        float64.
    """
    return _sampled_value(coefficients, stencil.places, stencil.shift, stencil.weights, point)


@kernel(inline="always")
def value_and_gradient_at(coefficients: Any, stencil: Stencil, point: Any) -> Any:
    """The filtered value and its gradient, a tuple as long as the point, per node; else as ``value_at``."""
    return _sampled_value_and_gradient(coefficients, stencil.places, stencil.shift, stencil.weights, point)


@kernel(inline="always")
def lies_within(point: Any, last: Any) -> Any:
    """Whether a point lies on the grid: two tuples of floats, nodes, the second of the last node."""
    return _lies_within(point, last)


@intrinsic
def _lies_within(typing: Any, point: Any, last: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return within(builder, *(cgutils.unpack_tuple(builder, place, len(point)) for place in arguments))

    return types.boolean(point, last), generate


@intrinsic
def _sampled_value(typing: Any, coefficients: Any, places: Any, shift: Any, weights: Any, point: Any) -> Any:
    _check(coefficients, weights, point)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return value(*_stage(context, builder, signature.args, arguments, slopes=False))

    return types.float64(coefficients, places, shift, weights, point), generate


@intrinsic
def _sampled_value_and_gradient(
    typing: Any, coefficients: Any, places: Any, shift: Any, weights: Any, point: Any
) -> Any:
    _check(coefficients, weights, point)
    gradient = types.UniTuple(types.float64, len(point))
    returned = types.Tuple((types.float64, gradient))

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        results = value_and_gradient(*_stage(context, builder, signature.args, arguments, slopes=True))
        slopes = context.make_tuple(builder, gradient, results[1:])
        return context.make_tuple(builder, returned, [results[0], slopes])

    return returned(coefficients, places, shift, weights, point), generate


def _check(coefficients: Any, weights: Any, point: Any) -> None:
    """The instructions read memory as these types lay it out; any other would give wrong numbers."""
    if coefficients.layout != "C" or coefficients.dtype not in (types.float64, types.float32):
        raise NumbaTypeError(f"coefficients are {coefficients}, accepted: C order, float64 or float32")
    if weights.layout != "C" or weights.dtype != coefficients.dtype:
        raise NumbaTypeError(f"weights are {weights}, accepted: stencil_of with the coefficients' type")
    if point != types.UniTuple(types.float64, coefficients.ndim):
        raise NumbaTypeError(f"point is {point}, accepted: a tuple of {coefficients.ndim} float64")


def _stage(
    context: Any, builder: Any, taken: Any, arguments: Any, *, slopes: bool
) -> tuple[Lanes, list[Axis], Any]:
    """Common start of both intrinsics: the filter's lanes, the axes and the start of the grid."""
    coefficients, length, _, weights, _ = taken
    lanes = Lanes(builder, len(length), DOUBLE if coefficients.dtype == types.float64 else FLOAT)
    grid = context.make_array(coefficients)(context, builder, arguments[0])
    tables = context.make_array(weights)(context, builder, arguments[3]).data
    counts = cgutils.unpack_tuple(builder, grid.shape, coefficients.ndim)
    point = [builder.extract_value(arguments[4], axis) for axis in range(coefficients.ndim)]
    places = builder.fadd(point_vector(builder, point), point_vector(builder, [arguments[2]] * len(point)))
    taps = INDEX(lanes.taps)
    ends = point_vector(builder, [builder.sitofp(builder.sub(count, taps), DOUBLE) for count in counts])
    strides = [INDEX(1)]
    for count in reversed(counts[1:]):
        strides.insert(0, builder.mul(strides[0], count))
    return lanes, axes_at(lanes, places, ends, strides, tables, slopes=slopes), grid.data

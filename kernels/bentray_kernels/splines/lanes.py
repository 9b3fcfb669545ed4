"""SIMD code generation for filters: fully unrolled LLVM vector instructions, one lane per node."""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]  # numba's own; it has no types
from numba.core import cgutils

DOUBLE, FLOAT = ir.DoubleType(), ir.FloatType()
INDEX, SHORT, BIT = ir.IntType(64), ir.IntType(32), ir.IntType(1)


def width_of(taps: int) -> int:
    """Lanes of a vector with one lane per tap: a power of two, unused lanes hold 0."""
    return 1 << (taps - 1).bit_length()


class Lanes:
    """Instructions on vectors of ``width`` lanes, one per tap, and on pairs of such vectors.

    Args:
        builder: of the LLVM instructions.
        taps: nodes that a point reads along one axis.
        real: LLVM's type of the numbers, float or double.
    """

    def __init__(self, builder: Any, taps: int, real: Any) -> None:
        self.builder = builder
        self.taps = taps
        self.width = width_of(taps)
        self.real = real

    def load_nodes(self, start: Any) -> Any:
        """Load ``taps`` neighbouring nodes, and no memory beyond them."""
        if self.width == self.taps:
            return self.load(start, self.width)
        row = ir.VectorType(self.real, self.width)
        mask = ir.VectorType(BIT, self.width)
        name = f"llvm.masked.load.v{self.width}f{8 * self._size()}.p0"
        load = self._instruction(name, row, [row.as_pointer(), SHORT, mask, row])
        mask_bits = ir.Constant(mask, [BIT(int(k < self.taps)) for k in range(self.width)])
        place = self.builder.bitcast(start, row.as_pointer())
        return self.builder.call(load, [place, SHORT(self._size()), mask_bits, ir.Constant(row, None)])

    def load(self, start: Any, count: int) -> Any:
        """Load a vector of ``count`` numbers."""
        numbers = self.builder.load(self.builder.bitcast(start, ir.VectorType(self.real, count).as_pointer()))
        numbers.align = self._size()
        return numbers

    def pick(self, vector: Any, places: Sequence[int], other: Any | None = None) -> Any:
        """Select lanes of a vector, or of the concatenation of two."""
        lanes = ir.Constant(ir.VectorType(SHORT, len(places)), [SHORT(k) for k in places])
        second = ir.Constant(vector.type, ir.Undefined) if other is None else other
        return self.builder.shuffle_vector(vector, second, lanes)

    def multiply_add(self, a: Any, b: Any, c: Any | None) -> Any:
        """a·b + c, fused where the processor supports it; without ``c`` the product."""
        if c is None:
            return self.builder.fmul(a, b)
        name = f"llvm.fmuladd.v{a.type.count}f{8 * self._size()}"
        return self.builder.call(self._instruction(name, a.type, [a.type] * 3), [a, b, c])

    def totals(self, vectors: Sequence[Any]) -> list[Any]:
        """Sum of the lanes of each of up to four vectors, as doubles, by pairwise addition of all at once."""
        width = vectors[0].type.count
        joined = self._joined(vectors)
        while width > 1:
            lanes, width = joined.type.count, width // 2
            even, odd = (self.pick(joined, range(first, lanes, 2)) for first in (0, 1))
            joined = self.builder.fadd(even, odd)
        if self.real == FLOAT:
            joined = self.builder.fpext(joined, ir.VectorType(DOUBLE, joined.type.count))
        return [self.builder.extract_element(joined, SHORT(k)) for k in range(len(vectors))]

    def _joined(self, vectors: Sequence[Any]) -> Any:
        """Concatenate vectors; a third one is repeated."""
        if len(vectors) == 1:
            return vectors[0]
        if len(vectors) > 2:
            pairs = [self._joined(vectors[:2]), self._joined((vectors[2], vectors[-1]))]
            return self._joined(pairs)
        first, second = vectors
        return self.pick(first, range(2 * first.type.count), second)

    def _size(self) -> int:
        return 8 if self.real == DOUBLE else 4

    def _instruction(self, name: str, returned: Any, taken: list[Any]) -> Any:
        return cgutils.get_or_insert_function(self.builder.module, ir.FunctionType(returned, taken), name)


def point_vector(builder: Any, numbers: Sequence[Any]) -> Any:
    """One double per axis, in a vector of 1, 2 or 4 lanes; an unused lane repeats the last one."""
    width = width_of(len(numbers))
    filled = [*numbers, *[numbers[-1]] * (width - len(numbers))]
    vector = ir.Constant(ir.VectorType(DOUBLE, width), ir.Undefined)
    for k, number in enumerate(filled):
        vector = builder.insert_element(vector, number, SHORT(k))
    return vector


def within(builder: Any, point: Sequence[Any], last: Sequence[Any]) -> Any:
    """Whether 0 ≤ place ≤ last along every axis."""
    places, ends = point_vector(builder, point), point_vector(builder, last)
    starts = ir.Constant(places.type, [DOUBLE(0.0)] * places.type.count)
    inside = builder.and_(
        builder.fcmp_ordered(">=", places, starts), builder.fcmp_ordered("<=", places, ends)
    )
    bits = builder.bitcast(inside, ir.IntType(places.type.count))
    return builder.icmp_unsigned("==", bits, ir.Constant(bits.type, -1))


class Axis:
    """One axis of a grid: nodes and weights of a point.

    Args:
        lanes: of the filter.
        stride: from one node to the next, in numbers.
        cell: the first node that is read.
        rest: how far into the cell the point lies, in all lanes.
        tables: start of ``Stencil.weights``.

    Attributes:
        stride: as given.
        offset: of the first node that is read, in numbers.
        weights: of the nodes, ``width`` lanes; where ``rest`` has twice as many, those of the slope follow.
    """

    def __init__(self, lanes: Lanes, stride: Any, cell: Any, rest: Any, tables: Any) -> None:
        self.lanes = lanes
        self.stride = stride
        self.offset = lanes.builder.mul(cell, stride)
        self.weights = self._horner(tables, rest)

    def weight(self, k: int, count: int) -> Any:
        """The weight of node ``k`` in so many lanes."""
        return self.lanes.pick(self.weights, [k] * count)

    def slope(self, k: int, count: int) -> Any:
        """Weights of the slope."""
        return self.lanes.pick(self.weights, [self.lanes.width + k] * count)

    def both(self, k: int) -> Any:
        """The weight in ``width`` lanes, then that of the slope in as many."""
        width = self.lanes.width
        return self.lanes.pick(self.weights, [k] * width + [width + k] * width)

    def _horner(self, tables: Any, rest: Any) -> Any:
        lanes, weights = self.lanes, None
        for power in reversed(range(lanes.taps)):
            row = lanes.builder.gep(tables, [INDEX(power * 2 * lanes.width)])
            row = lanes.load(row, rest.type.count)
            weights = row if weights is None else lanes.multiply_add(weights, rest, row)
        return weights


def axes_at(
    lanes: Lanes, places: Any, ends: Any, strides: Sequence[Any], tables: Any, *, slopes: bool
) -> list[Axis]:
    """The axes of a grid at a point.

    Args:
        lanes: of the filter.
        places: the point, nodes plus the filter's shift, as ``point_vector``.
        ends: the last cell along every axis, as ``point_vector``.
        strides: from one node to the next along every axis, in numbers.
        tables: start of ``Stencil.weights``.
        slopes: whether weights of the slope are needed.
    """
    builder = lanes.builder
    starts = ir.Constant(places.type, [DOUBLE(0.0)] * places.type.count)
    # Both comparisons are false for NaN, so that its index is inside the grid.
    inside = builder.select(builder.fcmp_ordered(">", places, starts), places, starts)
    inside = builder.select(builder.fcmp_ordered("<", inside, ends), inside, ends)
    cells = builder.fptosi(inside, ir.VectorType(INDEX, places.type.count))
    rests = builder.fsub(places, builder.sitofp(cells, places.type))
    if lanes.real == FLOAT:
        rests = builder.fptrunc(rests, ir.VectorType(FLOAT, places.type.count))
    width = 2 * lanes.width if slopes else lanes.width
    return [
        Axis(lanes, stride, builder.extract_element(cells, SHORT(k)), lanes.pick(rests, [k] * width), tables)
        for k, stride in enumerate(strides)
    ]


def value(lanes: Lanes, axes: Sequence[Axis], start: Any) -> Any:
    """The weighted sum of the nodes around a point.

    Args:
        lanes: of the filter.
        axes: of the grid, 1 to 3, without slopes; the last one is contiguous.
        start: of the grid.
    """

    def row(axes: Sequence[Axis], start: Any) -> Any:
        if len(axes) == 1:
            return lanes.load_nodes(start)
        total = None
        for k, node in _nodes(lanes, axes[0], start):
            total = lanes.multiply_add(axes[0].weight(k, lanes.width), row(axes[1:], node), total)
        return total

    row_of_all = row(axes, _first(lanes, axes, start))
    return lanes.totals([lanes.multiply_add(row_of_all, axes[-1].weights, None)])[0]


def value_and_gradient(lanes: Lanes, axes: Sequence[Axis], start: Any) -> list[Any]:
    """Value and gradient of the spline, for axes with slopes.

    A vector holds two rows of nodes: summed with the weights of the value, and with those of the slope along
    the second to last axis. So both take one multiplication, and the weights one polynomial.
    """
    first = _first(lanes, axes, start)
    low, high = range(lanes.width), range(lanes.width, 2 * lanes.width)

    def plane(start: Any) -> Any:
        """[value | slope along y] by node of z."""
        total = None
        for k, node in _nodes(lanes, axes[-2], start):
            twice = lanes.pick(lanes.load_nodes(node), [*low, *low])
            total = lanes.multiply_add(axes[-2].both(k), twice, total)
        return total

    along = axes[-1].weights
    if len(axes) == 1:
        row = lanes.load_nodes(first)
        twice = lanes.multiply_add(lanes.pick(row, [*low, *low]), along, None)
        return lanes.totals([lanes.pick(twice, low), lanes.pick(twice, high)])
    across = None
    if len(axes) == 2:
        rows = plane(first)
    else:
        rows = None
        for k, node in _nodes(lanes, axes[0], first):
            of_plane = plane(node)
            rows = lanes.multiply_add(axes[0].weight(k, 2 * lanes.width), of_plane, rows)
            across = lanes.multiply_add(axes[0].slope(k, lanes.width), lanes.pick(of_plane, low), across)
    value_row, slope_row = lanes.pick(rows, low), lanes.pick(rows, high)
    weights, slopes = lanes.pick(along, low), lanes.pick(along, high)
    products = [lanes.multiply_add(value_row, weights, None)]
    if across is not None:
        products.append(lanes.multiply_add(across, weights, None))
    products += [lanes.multiply_add(slope_row, weights, None), lanes.multiply_add(value_row, slopes, None)]
    return lanes.totals(products)


def _first(lanes: Lanes, axes: Sequence[Axis], start: Any) -> Any:
    offset = axes[0].offset
    for axis in axes[1:]:
        offset = lanes.builder.add(offset, axis.offset)
    return lanes.builder.gep(start, [offset])


def _nodes(lanes: Lanes, axis: Axis, start: Any) -> Any:
    """Indices and addresses of the nodes along an axis."""
    for k in range(lanes.taps):
        yield k, lanes.builder.gep(start, [lanes.builder.mul(INDEX(k), axis.stride)])

"""The vector instructions that read a filter's nodes: written out for LLVM, with no loop left in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]  # numba's own; it has no types
from numba.core import cgutils

DOUBLE, FLOAT = ir.DoubleType(), ir.FloatType()
INDEX, SHORT, BIT = ir.IntType(64), ir.IntType(32), ir.IntType(1)


class Lanes:
    """Vectors of doubles with one lane a tap, filled up to a power of two by lanes that hold 0.

    Args:
        builder: where the instructions go.
        taps: nodes that a point reads along one axis.
    """

    def __init__(self, builder: Any, taps: int) -> None:
        self.builder = builder
        self.taps = taps
        self.width = 1 << (taps - 1).bit_length()
        self.type = ir.VectorType(DOUBLE, self.width)

    def load(self, start: Any, element: Any) -> Any:
        """``taps`` numbers of the type ``element`` from memory; nothing beyond them is touched."""
        read = ir.VectorType(element, self.width)
        place = self.builder.bitcast(start, read.as_pointer())
        align = 8 if element == DOUBLE else 4
        if self.width == self.taps:
            numbers = self.builder.load(place)
            numbers.align = align
        else:
            mask = ir.VectorType(BIT, self.width)
            name = f"llvm.masked.load.v{self.width}f{8 * align}.p0"
            load = self._instruction(name, read, [read.as_pointer(), SHORT, mask, read])
            wanted = ir.Constant(mask, [BIT(int(k < self.taps)) for k in range(self.width)])
            numbers = self.builder.call(load, [place, SHORT(align), wanted, ir.Constant(read, None)])
        return numbers if element == DOUBLE else self.builder.fpext(numbers, self.type)

    def everywhere(self, number: Any) -> Any:
        """A number in all lanes."""
        first = self.builder.insert_element(ir.Constant(self.type, ir.Undefined), number, SHORT(0))
        return self.lane(first, 0)

    def lane(self, vector: Any, k: int) -> Any:
        """Lane ``k`` of a vector in all lanes."""
        places = ir.Constant(ir.VectorType(SHORT, self.width), [SHORT(k)] * self.width)
        return self.builder.shuffle_vector(vector, ir.Constant(self.type, ir.Undefined), places)

    def multiply_add(self, a: Any, b: Any, c: Any | None) -> Any:
        """a·b + c, rounded once where the processor can; without ``c`` the product."""
        if c is None:
            return self.builder.fmul(a, b)
        name = f"llvm.fmuladd.v{self.width}f64"
        return self.builder.call(self._instruction(name, self.type, [self.type] * 3), [a, b, c])

    def total(self, vector: Any) -> Any:
        """Sum of the lanes."""
        name = f"llvm.vector.reduce.fadd.v{self.width}f64"
        add = self._instruction(name, DOUBLE, [DOUBLE, self.type])
        # In halves instead of one after the other.
        return self.builder.call(add, [DOUBLE(0.0), vector], fastmath=("reassoc",))

    def _instruction(self, name: str, returned: Any, taken: list[Any]) -> Any:
        return cgutils.get_or_insert_function(self.builder.module, ir.FunctionType(returned, taken), name)


class Axis:
    """One axis of a grid, and where the point lies along it.

    Args:
        lanes: of the filter.
        count: nodes of the axis, border included.
        stride: from one node to the next, in numbers.
        place: of the point, nodes, plus the filter's shift.
        tables: start of ``Stencil.weights``.
        slopes: whether the weights of the slope are asked for.

    Attributes:
        stride: as given.
        offset: of the first node that is read, in numbers.
        weights: a vector: of the value by node, and of the slope or None.
    """

    def __init__(self, lanes: Lanes, count: Any, stride: Any, place: Any, tables: Any, slopes: bool) -> None:
        builder = lanes.builder
        last = builder.sitofp(builder.sub(count, INDEX(lanes.taps)), DOUBLE)
        # Both comparisons are false for NaN, which so reads a node of the grid.
        within = builder.select(builder.fcmp_ordered(">", place, DOUBLE(0.0)), place, DOUBLE(0.0))
        within = builder.select(builder.fcmp_ordered("<", within, last), within, last)
        cell = builder.fptosi(within, INDEX)
        t = lanes.everywhere(builder.fsub(place, builder.sitofp(cell, DOUBLE)))
        self.stride = stride
        self.offset = builder.mul(cell, stride)
        self.value = _horner(lanes, tables, 0, t)
        self.slope = _horner(lanes, tables, 1, t) if slopes else None


def sums(lanes: Lanes, axes: Sequence[Axis], start: Any, element: Any) -> list[Any]:
    """The weighted sum of the nodes about a point, and those with the slope's weights along each axis.

    Args:
        lanes: of the filter.
        axes: of the grid, the last one contiguous.
        start: of the grid.
        element: type of its numbers.

    Returns:
        The value; then, if the axes have slopes, the gradient.
    """
    offset = axes[0].offset
    for axis in axes[1:]:
        offset = lanes.builder.add(offset, axis.offset)
    rows = _rows(lanes, axes, lanes.builder.gep(start, [offset]), element)
    last = axes[-1]
    values = [lanes.total(lanes.multiply_add(row, last.value, None)) for row in rows]
    if last.slope is not None:
        values.append(lanes.total(lanes.multiply_add(rows[0], last.slope, None)))
    return values


def _rows(lanes: Lanes, axes: Sequence[Axis], start: Any, element: Any) -> list[Any]:
    """Summed over all axes but the last: the value, then the slopes along these axes."""
    if len(axes) == 1:
        return [lanes.load(start, element)]
    axis, inner = axes[0], axes[1:]
    summed: list[Any] = [None] * (len(axes) if axis.slope is not None else 1)
    for k in range(lanes.taps):
        node = lanes.builder.gep(start, [lanes.builder.mul(INDEX(k), axis.stride)])
        value, *across = _rows(lanes, inner, node, element)
        weight = lanes.lane(axis.value, k)
        terms = [(weight, value)]
        if axis.slope is not None:
            terms.append((lanes.lane(axis.slope, k), value))
        terms += [(weight, row) for row in across]
        summed = [lanes.multiply_add(*term, before) for term, before in zip(terms, summed, strict=True)]
    return summed


def _horner(lanes: Lanes, tables: Any, table: int, t: Any) -> Any:
    """The weights of all nodes at t, by falling powers."""
    weights = None
    # A slope's polynomial has one power less.
    for power in reversed(range(lanes.taps - table)):
        row = lanes.builder.gep(tables, [INDEX((table * lanes.taps + power) * lanes.taps)])
        coefficients = lanes.load(row, DOUBLE)
        weights = coefficients if weights is None else lanes.multiply_add(weights, t, coefficients)
    return weights

"""Interpolation filters: nodes and polynomial weights of a point."""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput

Polynomial = list[Fraction]


@dataclass(frozen=True)
class Filter:
    """A separable filter whose weights are polynomials of the position within a cell of the filter.

    A point x (in nodes) lies in the filter's cell i = ⌊x + shift⌋ at t = x + shift − i, 0 ≤ t < 1, and reads
    the nodes i − before … i − before + taps − 1. Along one axis its value is Σ value[k]·c[k] and its slope
    Σ slope[k]·c[k], where each weight is Σ_p matrix[k, p]·t^p. In several dimensions the weights of the axes
    are multiplied.

    Attributes:
        name: as in ``FILTERS``.
        order: the polynomial degree n of a B-spline, 0 for a filter without prefilter.
        shift: 0, or ½ for B-splines of even order, whose knots lie between the nodes.
        before: how many nodes before cell i are read.
        value: (taps, degree + 1) coefficients of rising powers of t.
        slope: (taps, degree + 1) the same for the derivative, per node.
    """

    name: str
    order: int
    shift: float
    before: int
    value: Floats
    slope: Floats

    @property
    def taps(self) -> int:
        """Number of nodes per point along one axis."""
        return len(self.value)


def bspline(order: int) -> Filter:
    """The B-spline of order (degree) n, 1 or more, by truncated powers (dissertation, equation 7)."""
    shift = Fraction((order + 1) % 2, 2)
    before = order // 2
    weights = [_bspline_piece(order, before - shift - tap) for tap in range(order + 1)]
    return _filter(f"bspline{order}", order, shift, before, weights, [_derived(weight) for weight in weights])


def trilinear() -> Filter:
    """Linear along each axis, with the analytic derivative (piecewise constant along its own axis)."""
    weights = [[Fraction(1), Fraction(-1)], [Fraction(0), Fraction(1)]]
    return _filter("trilinear", 0, Fraction(0), 0, weights, [_derived(weight) for weight in weights])


def central() -> Filter:
    """Linear values, and slopes interpolated linearly between the central differences of the nodes."""
    half, none = Fraction(1, 2), Fraction(0)
    values = [[none], [Fraction(1), Fraction(-1)], [none, Fraction(1)], [none]]
    slopes = [[-half, half], [none, -half], [half, -half], [none, half]]
    return _filter("central", 0, none, 1, values, slopes)


def catmull_rom() -> Filter:
    """Cubic convolution with a = −½ (Keys 1981) and its analytic derivative."""
    half = Fraction(1, 2)
    rows = [(0, -1, 2, -1), (2, 0, -5, 3), (0, 1, 4, -3), (0, 0, -1, 1)]
    weights = [[half * entry for entry in row] for row in rows]
    return _filter("catmull-rom", 0, Fraction(0), 1, weights, [_derived(weight) for weight in weights])


def _bspline_piece(order: int, offset: Fraction) -> Polynomial:
    """The B-spline at t + offset, for t between 0 and 1, by rising powers of t."""
    middle = Fraction(order + 1, 2)
    piece = [Fraction(0)] * (order + 1)
    for j in range(order + 2):
        start = offset + middle - j
        if start < 0:
            continue
        share = Fraction((-1) ** j * math.comb(order + 1, j), math.factorial(order))
        for power in range(order + 1):
            piece[power] += share * math.comb(order, power) * start ** (order - power)
    return piece


def _derived(polynomial: Polynomial) -> Polynomial:
    return [power * entry for power, entry in enumerate(polynomial)][1:] or [Fraction(0)]


def _filter(
    name: str, order: int, shift: Fraction, before: int, values: list[Polynomial], slopes: list[Polynomial]
) -> Filter:
    powers = max(len(row) for row in values + slopes)

    def matrix(rows: list[Polynomial]) -> Floats:
        full = np.array([[float(entry) for entry in row] + [0.0] * (powers - len(row)) for row in rows])
        full.setflags(write=False)
        return full

    return Filter(name, order, float(shift), before, matrix(values), matrix(slopes))


FILTERS: dict[str, Filter] = {
    made.name: made for made in (central(), trilinear(), catmull_rom(), *(bspline(n) for n in range(2, 7)))
}


def filter_of(name: str) -> Filter:
    """The filter of that name.

    Raises:
        InvalidInput: for an unknown name.
    """
    if name not in FILTERS:
        raise InvalidInput("filter", name, "one of " + ", ".join(FILTERS))
    return FILTERS[name]

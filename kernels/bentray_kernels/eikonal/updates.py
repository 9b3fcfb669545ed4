"""Local (Godunov) updates of a node from its upwind neighbours; every solver shares them.

All arrays are flat over a grid with a border of one node. ``strides`` has three entries; a grid of two
axes has 0 for the third, whose neighbour is then the node itself and never settled. ``settled`` holds
the final times and infinity elsewhere, so an unknown neighbour drops out of every minimum by itself.
"""

import math
from typing import NamedTuple

from ..arrays import Floats
from ..compilation.compiled import kernel

# Two nodes at one distance from the source differ by rounding; neither is later.
TIE = 1e-12

# A source on the next line of nodes is not beside a node, whichever way the squares of its times round.
ON_LINE = 1e-6

# Whichever way a front comes in, even from a source in the next cell, a node is later than its earliest
# neighbour by √2 − 1 of the crossing time in 2-D, √3 − √2 in 3-D, or more. Second differences across a kink
# can fall below it; the factored update takes at least this, a little less.
RISE_2D = 0.4
RISE_3D = 0.3

# An axis of the plain scheme: T at the base of the difference, its weight, time of the nearest neighbour.
PlainAxis = tuple[float, float, float]

# An axis of the factored scheme: slope and shift of ∂T/∂x = slope·τ + shift, time of the nearest
# neighbour, offset to it.
FactoredAxis = tuple[float, float, float, int]


class Front(NamedTuple):
    """A factored solution T = T0·τ, flat and padded; ``tau`` and ``settled`` are filled node by node.

    Attributes:
        strides, spacing, slowness: of the grid.
        squares: T0² of every node, border included, s².
        limit: 4·(source slowness·spacing)²; a source nearer than the spacing differs by less.
        least: lowest slowness of the grid over that at the source, which is the least possible τ.
        tau: τ of settled nodes.
        settled: final times, s; infinity elsewhere.
    """

    strides: tuple[int, int, int]
    spacing: float
    slowness: Floats
    squares: Floats
    limit: float
    least: float
    tau: Floats
    settled: Floats


@kernel(inline="always")
def plain_axis(node: int, stride: int, settled: Floats, second_order: bool) -> PlainAxis:
    """One axis of the upwind difference; its time is infinite where no neighbour is settled.

    The derivative is (T − T1)/h, or (3T − 4T1 + T2)/(2h) where the second neighbour is settled and not
    later than the first (chapter 6, equation 3); both are sqrt(weight)·(T − base)/h.
    """
    left = settled[node - stride]
    right = settled[node + stride]
    if left <= right:
        # Beyond the border there is nothing to read; an infinite first neighbour may be the border.
        first, second = left, (settled[node - 2 * stride] if left < math.inf else math.inf)
    else:
        first, second = right, settled[node + 2 * stride]
    if second_order and second <= first * (1.0 + TIE) and first < math.inf:
        return (4.0 * first - second) / 3.0, 2.25, first
    return first, 1.0, first


@kernel(inline="always")
def plain_update(
    node: int, strides: tuple[int, int, int], rhs: float, settled: Floats, second_order: bool
) -> float:
    """Travel time of one node from its settled neighbours (Sethian 1996; order two: Sethian 1999).

    T with Σ weight·(T − base)² = rhs², rhs being spacing times slowness, s. An axis whose neighbour is
    later than the root breaks causality and is dropped, the latest first.
    """
    a = plain_axis(node, strides[0], settled, second_order)
    b = plain_axis(node, strides[1], settled, second_order)
    if b[2] < a[2]:
        a, b = b, a
    if strides[2] != 0:
        c = plain_axis(node, strides[2], settled, second_order)
        if c[2] < b[2]:
            b, c = c, b
            if b[2] < a[2]:
                a, b = b, a
        if c[2] < math.inf:
            weights = a[1] + b[1] + c[1]
            mixed = a[1] * a[0] + b[1] * b[0] + c[1] * c[0]
            squares = a[1] * a[0] * a[0] + b[1] * b[0] * b[0] + c[1] * c[0] * c[0]
            root = mixed * mixed - weights * (squares - rhs * rhs)
            if root >= 0.0:
                time = (mixed + math.sqrt(root)) / weights
                if time >= c[2]:
                    return time
    if b[2] < math.inf:
        gap = b[0] - a[0]
        root = (a[1] + b[1]) * rhs * rhs - a[1] * b[1] * gap * gap
        if root >= 0.0:
            time = (a[1] * a[0] + b[1] * b[0] + math.sqrt(root)) / (a[1] + b[1])
            if time >= b[2]:
                return time
    time = a[0] + rhs / math.sqrt(a[1])
    # The second-order difference of a single axis can fall below its neighbour; first order cannot.
    return time if time >= a[2] else a[2] + rhs


@kernel(inline="always")
def factored_axis(node: int, stride: int, inverse_4t0: float, front: Front) -> FactoredAxis:
    """One axis of the factored difference, taken positive away from its neighbour, over T0/h.

    Where no neighbour is settled the time is infinite and the offset 0. The slope is then that of T0 if
    the source lies beside the node, between two node lines (the minimum along the axis is at no node,
    so ∂T/∂x is not 0 there), and else 0. ``inverse_4t0`` is 1/(4·T0²).
    """
    squares, tau, settled = front.squares, front.tau, front.settled
    left = settled[node - stride]
    right = settled[node + stride]
    first = min(left, right)
    # h·s0²·x from the squares of T0 either side, exactly: no coordinates need to be kept.
    difference = squares[node + stride] - squares[node - stride]
    if first == math.inf:
        return _across(abs(difference), inverse_4t0, front.limit), 0.0, math.inf, 0
    offset = -stride if left <= right else stride
    along = difference if left <= right else -difference
    second = settled[node + 2 * offset]
    weight = 1.5 if second <= first else 1.0
    # Second order: 3/2·(4τ1 − τ2)/3; first order: τ1.
    near = tau[node + offset]
    shift = 2.0 * near - 0.5 * tau[node + 2 * offset] if second <= first else near
    return weight + along * inverse_4t0, -shift, first, offset


@kernel(inline="always")
def _across(difference: float, inverse_4t0: float, limit: float) -> float:
    """Slope of an axis that has no neighbour upwind; ``difference`` is that of T0² either side."""
    return difference * inverse_4t0 if difference < limit * (1.0 - ON_LINE) else 0.0


@kernel(inline="always")
def factored_update(node: int, front: Front) -> float:
    """Travel time of one node with T = T0·τ, T0 the time in the source's own slowness.

    Only the smooth factor τ is differenced, so the source's singularity costs no accuracy (Fomel, Luo &
    Zhao 2009; Treister & Haber 2016). With derivatives in units of T0/h, Σ (slope·τ + shift)² =
    (h·slowness/T0)² is solved for the downwind root; an axis that is later than the root, or not
    upwind, is dropped, the latest first.
    """
    strides, spacing, slowness = front.strides, front.spacing, front.slowness
    square = front.squares[node]
    inverse = 1.0 / square
    inverse_4t0 = 0.25 * inverse
    base = math.sqrt(square)
    local = spacing * slowness[node]
    rhs = local * local * inverse
    a = factored_axis(node, strides[0], inverse_4t0, front)
    b = factored_axis(node, strides[1], inverse_4t0, front)
    c = (0.0, 0.0, math.inf, 0)
    if strides[2] != 0:
        c = factored_axis(node, strides[2], inverse_4t0, front)
    # Nearly every node: all axes have a neighbour, and the root is downwind of them.
    slopes = a[0] * a[0] + b[0] * b[0] + c[0] * c[0]
    mixed = a[0] * a[1] + b[0] * b[1] + c[0] * c[1]
    shifts = a[1] * a[1] + b[1] * b[1] + c[1] * c[1] - rhs
    root = mixed * mixed - slopes * shifts
    latest = max(a[2], b[2])
    if strides[2] != 0:
        latest = max(latest, c[2])
    if root >= 0.0 and latest < math.inf:
        factor = (math.sqrt(root) - mixed) / slopes
        if (
            base * factor >= latest * (1.0 - TIE)
            and a[0] * factor + a[1] >= 0.0
            and b[0] * factor + b[1] >= 0.0
            and c[0] * factor + c[1] >= 0.0
        ):
            first = a if a[2] <= b[2] else b
            first = c if c[2] < first[2] else first
            beside = spacing * slowness[node + first[3]]
            return _possible(base * factor, first[2], local, beside, strides[2] != 0, base * front.least)
    return _factored_fewer(a, b, c, node, base, local, rhs, front)


@kernel(inline="always")
def _factored_fewer(
    a: FactoredAxis,
    b: FactoredAxis,
    c: FactoredAxis,
    node: int,
    base: float,
    local: float,
    rhs: float,
    front: Front,
) -> float:
    """The update where an axis has no neighbour or must be dropped, which comes to the same."""
    squares, limit = front.squares, front.limit
    if b[2] < a[2]:
        a, b = b, a
    if c[2] < b[2]:
        b, c = c, b
        if b[2] < a[2]:
            a, b = b, a
    slopes = a[0] * a[0]
    mixed = a[0] * a[1]
    shifts = a[1] * a[1] - rhs
    # Axes beside the source turn the front even without a neighbour.
    inverse_4t0 = 0.25 / squares[node]
    across_b = b[0]
    if b[2] < math.inf:
        across_b = _across(abs(squares[node + b[3]] - squares[node - b[3]]), inverse_4t0, limit)
    across_c = c[0]
    if c[2] < math.inf:
        across_c = _across(abs(squares[node + c[3]] - squares[node - c[3]]), inverse_4t0, limit)
    factor = -1.0
    if c[2] < math.inf:
        factor = factored_root(
            slopes + b[0] * b[0] + c[0] * c[0],
            mixed + b[0] * b[1] + c[0] * c[1],
            shifts + b[1] * b[1] + c[1] * c[1],
            c[2],
            base,
        )
        if a[0] * factor + a[1] < 0.0 or b[0] * factor + b[1] < 0.0 or c[0] * factor + c[1] < 0.0:
            factor = -1.0
    slopes_c = slopes + across_c * across_c
    if factor < 0.0 and b[2] < math.inf:
        factor = factored_root(slopes_c + b[0] * b[0], mixed + b[0] * b[1], shifts + b[1] * b[1], b[2], base)
        if a[0] * factor + a[1] < 0.0 or b[0] * factor + b[1] < 0.0:
            factor = -1.0
    if factor < 0.0:
        factor = factored_root(slopes_c + across_b * across_b, mixed, shifts, a[2], base)
        if a[0] * factor + a[1] < 0.0:
            factor = -1.0
    if factor < 0.0:
        factor = factored_root(slopes, mixed, shifts, a[2], base)
        if a[0] * factor + a[1] < 0.0:
            factor = -1.0
    beside = front.spacing * front.slowness[node + a[3]]
    if factor < 0.0:
        return float(a[2] + 0.5 * (local + beside))
    return _possible(base * factor, a[2], local, beside, front.strides[2] != 0, base * front.least)


@kernel(inline="always")
def _possible(time: float, first: float, local: float, beside: float, space: bool, soonest: float) -> float:
    """A time limited to what is possible for a wave.

    Args:
        time: of the update, s.
        first: time of the earliest neighbour, s.
        local, beside: crossing times of the node and of that neighbour, s; straight from the neighbour at the
            slower of the two is the latest.
        space: whether there are three axes.
        soonest: straight from the source at the highest speed of the grid, s.
    """
    rise = (RISE_3D if space else RISE_2D) * min(local, beside)
    return float(max(soonest, first + rise, min(time, first + max(local, beside))))


@kernel(inline="always")
def factored_root(a: float, b: float, c: float, latest: float, base: float) -> float:
    """Downwind root of a·τ² + 2b·τ + c = 0, or −1 where none is as late as ``latest``."""
    root = b * b - a * c
    if root < 0.0 or a <= 0.0:
        return -1.0
    factor = (math.sqrt(root) - b) / a
    return factor if base * factor >= latest * (1.0 - TIE) else -1.0


@kernel(inline="always")
def first_order_2d(a: float, b: float, rhs: float) -> float:
    """First-order time from the earlier neighbour of each of two axes (Zhao 2005, equation 2.4)."""
    if abs(a - b) >= rhs:
        return min(a, b) + rhs
    return 0.5 * (a + b + math.sqrt(2.0 * rhs * rhs - (a - b) * (a - b)))


@kernel(inline="always")
def first_order_3d(a: float, b: float, c: float, rhs: float) -> float:
    """Like ``first_order_2d`` with three axes: take in the axes in order of time while they are upwind."""
    low = min(a, min(b, c))
    high = max(a, max(b, c))
    middle = max(min(a, b), min(max(a, b), c))
    time = low + rhs
    if time > middle:
        time = 0.5 * (low + middle + math.sqrt(2.0 * rhs * rhs - (low - middle) * (low - middle)))
        if time > high:
            total = low + middle + high
            squares = low * low + middle * middle + high * high
            time = (total + math.sqrt(total * total - 3.0 * (squares - rhs * rhs))) / 3.0
    return time

"""Local (Godunov) updates of a node from its upwind neighbours; every solver shares them.

All arrays are flat over a grid with a border of one node. ``strides`` has three entries; a grid of two
axes has 0 for the third, whose neighbour is then the node itself and never settled. ``settled`` holds
the final times and infinity elsewhere, so an unknown neighbour drops out of every minimum by itself.
"""

from __future__ import annotations

import math

from ..arrays import Floats
from ..compiled import kernel

# Two nodes at one distance either side of the source differ by rounding; neither is later.
TIE = 1e-12

# An axis of the plain scheme: T at the base of the difference, its weight, time of the nearest neighbour.
PlainAxis = tuple[float, float, float]

# An axis of the factored scheme: slope and shift of ∂T/∂x = slope·τ + shift, time of the nearest
# neighbour, offset to it.
FactoredAxis = tuple[float, float, float, int]


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
    if second_order and second <= first and first < math.inf:
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
def factored_axis(
    node: int,
    stride: int,
    spacing: float,
    base: float,
    squares: Floats,
    tau: Floats,
    settled: Floats,
    limit: float,
) -> FactoredAxis:
    """One axis of the factored difference, taken positive away from its neighbour.

    Where no neighbour is settled the time is infinite and the offset 0. The slope is then that of T0 if
    the source lies beside the node, between two node lines (the minimum along the axis is at no node,
    so ∂T/∂x is not 0 there), and else 0.
    """
    left = settled[node - stride]
    right = settled[node + stride]
    # s0²·x from the squares of T0 either side, exactly: no coordinates need to be kept.
    along = (squares[node + stride] - squares[node - stride]) / (4.0 * spacing * base)
    if left == math.inf and right == math.inf:
        return (abs(along) if abs(along) * base < limit else 0.0), 0.0, math.inf, 0
    offset = -stride if left <= right else stride
    first = min(left, right)
    near = tau[node + offset]
    weight = base / spacing
    second = settled[node + 2 * offset]
    if second <= first:
        near = (4.0 * near - tau[node + 2 * offset]) / 3.0
        weight *= 1.5
    if offset > 0:
        along = -along
    return along + weight, -weight * near, first, offset


@kernel(inline="always")
def factored_root(a: float, b: float, c: float, latest: float, base: float) -> float:
    """Downwind root of a·τ² + 2b·τ + c = 0, or −1 where none is as late as ``latest``."""
    root = b * b - a * c
    if root < 0.0 or a <= 0.0:
        return -1.0
    factor = (-b + math.sqrt(root)) / a
    return factor if base * factor >= latest * (1.0 - TIE) else -1.0


@kernel(inline="always")
def factored_update(
    node: int,
    strides: tuple[int, int, int],
    spacing: float,
    slowness: Floats,
    squares: Floats,
    tau: Floats,
    settled: Floats,
    limit: float,
) -> float:
    """Travel time of one node with T = T0·τ, T0 the time in the source's own slowness.

    Only the smooth factor τ is differenced, so the source's singularity costs no accuracy (Fomel, Luo &
    Zhao 2009; Treister & Haber 2016). Σ (slope·τ + shift)² = slowness² is solved for the downwind root;
    an axis that is later than the root, or not upwind, is dropped, the latest first.

    Args:
        squares: T0² of every node, border included, s².
        limit: (source slowness)²·spacing; |x| < spacing is |x|·s0² < limit.
    """
    base = math.sqrt(squares[node])
    local = slowness[node]
    a = factored_axis(node, strides[0], spacing, base, squares, tau, settled, limit)
    b = factored_axis(node, strides[1], spacing, base, squares, tau, settled, limit)
    c = (0.0, 0.0, math.inf, 0)
    if b[2] < a[2]:
        a, b = b, a
    if strides[2] != 0:
        c = factored_axis(node, strides[2], spacing, base, squares, tau, settled, limit)
        if c[2] < b[2]:
            b, c = c, b
            if b[2] < a[2]:
                a, b = b, a
    # Coefficients of the quadratic: the earliest axis, and those beside the source without a neighbour.
    slopes = a[0] * a[0]
    mixed = a[0] * a[1]
    shifts = a[1] * a[1] - local * local
    if b[2] == math.inf:
        slopes += b[0] * b[0]
    if c[2] == math.inf:
        slopes += c[0] * c[0]
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
    if factor < 0.0 and b[2] < math.inf:
        factor = factored_root(slopes + b[0] * b[0], mixed + b[0] * b[1], shifts + b[1] * b[1], b[2], base)
        if a[0] * factor + a[1] < 0.0 or b[0] * factor + b[1] < 0.0:
            factor = -1.0
    if factor < 0.0:
        factor = factored_root(slopes, mixed, shifts, a[2], base)
        if a[0] * factor + a[1] < 0.0:
            factor = -1.0
    beside = slowness[node + a[3]]
    if factor < 0.0:
        return float(a[2] + 0.5 * spacing * (local + beside))
    # No time is later than straight from the earliest neighbour at the slower of the two nodes.
    return float(min(base * factor, a[2] + spacing * max(local, beside)))


@kernel(inline="always")
def first_order_2d(a: float, b: float, rhs: float) -> float:
    """First-order time from the earlier neighbour of each of two axes (Zhao 2005, equation 2.4)."""
    if abs(a - b) >= rhs:
        return min(a, b) + rhs
    return 0.5 * (a + b + math.sqrt(2.0 * rhs * rhs - (a - b) * (a - b)))


@kernel(inline="always")
def first_order_3d(a: float, b: float, c: float, rhs: float) -> float:
    """As ``first_order_2d`` with three axes: take in the axes in order of time while they are upwind."""
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

"""Local (Godunov) updates of a node from its upwind neighbours; every solver shares them.

All arrays are flat over a grid with a border of one node. ``strides`` is a tuple, one entry an axis, so
that the compiler unrolls the loops over axes. ``accepted`` marks the nodes whose time may be used.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Flags, Floats
from ..compiled import kernel

# Two nodes at one distance either side of the source differ by rounding; neither is later.
TIE = 1e-12


@kernel(inline="always")
def solve_upwind(times: Floats, weights: Floats, newest: Floats, count: int, rhs: float) -> float:
    """Largest T with Σ w (T − t)² = rhs² that lies downwind of all its neighbours.

    ``newest`` holds each axis's nearest neighbour time. An axis whose neighbour is later than the
    root breaks causality: the latest is dropped and the rest solved again.
    """
    while True:
        a = 0.0
        b = 0.0
        c = -rhs * rhs
        latest = 0
        for k in range(count):
            a += weights[k]
            b += weights[k] * times[k]
            c += weights[k] * times[k] * times[k]
            if newest[k] > newest[latest]:
                latest = k
        root = b * b - a * c
        if root >= 0.0:
            time = (b + math.sqrt(root)) / a
            if time >= newest[latest]:
                return time
        if count == 1:
            # The second-order stencil of a single axis can fall below its neighbour; first order cannot.
            return float(newest[0] + rhs)
        count -= 1
        times[latest] = times[count]
        weights[latest] = weights[count]
        newest[latest] = newest[count]


@kernel(inline="always")
def upwind(node: int, stride: int, time: Floats, accepted: Flags) -> int:
    """Offset to the earlier accepted neighbour along one axis, 0 where there is none."""
    left = time[node - stride] if accepted[node - stride] else math.inf
    right = time[node + stride] if accepted[node + stride] else math.inf
    if left == math.inf and right == math.inf:
        return 0
    return -stride if left <= right else stride


@kernel
def plain_update(
    node: int,
    strides: tuple[int, ...],
    spacing: float,
    slowness: Floats,
    time: Floats,
    accepted: Flags,
    second_order: bool,
    times: Floats,
    weights: Floats,
    newest: Floats,
) -> float:
    """Travel time of one node from its accepted neighbours (Sethian 1996; order two: Sethian 1999).

    Derivatives are (T − T1)/h, or (3T − 4T1 + T2)/(2h) where the second neighbour is accepted and
    not later than the first (chapter 6, equation 3). ``times``, ``weights`` and ``newest`` are scratch.
    """
    count = 0
    for axis in range(len(strides)):
        offset = upwind(node, strides[axis], time, accepted)
        if offset == 0:
            continue
        first = time[node + offset]
        times[count] = first
        weights[count] = 1.0
        newest[count] = first
        if second_order and accepted[node + 2 * offset]:
            second = time[node + 2 * offset]
            if second <= first:
                times[count] = (4.0 * first - second) / 3.0
                weights[count] = 2.25
        count += 1
    return solve_upwind(times, weights, newest, count, spacing * slowness[node])


@kernel
def factored_update(
    node: int,
    strides: tuple[int, ...],
    spacing: float,
    slowness: Floats,
    source_slowness: float,
    offset_m: Floats,
    reference: Floats,
    tau: Floats,
    time: Floats,
    accepted: Flags,
    slope: Floats,
    shift: Floats,
    newest: Floats,
) -> float:
    """Travel time of one node with T = T0·τ, T0 the time in the source's own slowness.

    Only the smooth factor τ is differenced, so the source's singularity costs no accuracy (Fomel,
    Luo & Zhao 2009; Treister & Haber 2016). Upwind along an axis, ∂T/∂x is slope·τ + shift; the
    nodal equation Σ (slope·τ + shift)² = slowness² is solved for the downwind root. ``offset_m`` is the
    node minus the source, (ndim,), m; ``slope``, ``shift`` and ``newest`` are scratch.
    """
    base = reference[node]
    local = slowness[node]
    count = 0
    earliest = math.inf
    beside = local
    for axis in range(len(strides)):
        offset = upwind(node, strides[axis], time, accepted)
        if offset == 0:
            # Beside a source between two node lines the minimum along the axis is at no node, so
            # ∂T/∂x is not 0 there but that of T0.
            if 0.0 < abs(offset_m[axis]) < spacing:
                slope[count] = source_slowness * source_slowness * abs(offset_m[axis]) / base
                shift[count] = 0.0
                newest[count] = -1.0
                count += 1
            continue
        sign = 1.0 if offset > 0 else -1.0
        near = tau[node + offset]
        weight = 1.0
        if accepted[node + 2 * offset] and time[node + 2 * offset] <= time[node + offset]:
            near = (4.0 * near - tau[node + 2 * offset]) / 3.0
            weight = 1.5
        # ∂T0/∂x = s0²·x/T0; signs are turned so that the derivative is positive away from the neighbour.
        along = -sign * source_slowness * source_slowness * offset_m[axis] / base
        slope[count] = along + weight * base / spacing
        shift[count] = -weight * base * near / spacing
        newest[count] = time[node + offset]
        if newest[count] < earliest:
            earliest = newest[count]
            beside = slowness[node + offset]
        count += 1
    # The way straight from the earliest neighbour: no time is later than along it at its slower end.
    latest_possible = earliest + spacing * max(local, beside)
    while count > 0:
        a = 0.0
        b = 0.0
        c = -local * local
        latest = 0
        for k in range(count):
            a += slope[k] * slope[k]
            b += slope[k] * shift[k]
            c += shift[k] * shift[k]
            if newest[k] > newest[latest]:
                latest = k
        if newest[latest] < 0.0:
            break
        root = b * b - a * c
        if root >= 0.0 and a > 0.0:
            factor = (-b + math.sqrt(root)) / a
            upwinded = base * factor >= newest[latest] * (1.0 - TIE)
            for k in range(count):
                upwinded = upwinded and slope[k] * factor + shift[k] >= 0.0
            if upwinded:
                return float(min(base * factor, latest_possible))
        count -= 1
        slope[latest] = slope[count]
        shift[latest] = shift[count]
        newest[latest] = newest[count]
    return float(earliest + 0.5 * spacing * (local + beside))


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


@kernel
def scratch(axes: int) -> tuple[Floats, Floats, Floats]:
    """Three small arrays for the updates above; made once a solve."""
    return np.empty(axes), np.empty(axes), np.empty(axes)

"""Deviation of travel times from a homogeneous medium: additively factored second-order sweeping, 2-D.

With the slowness s0 of the source and the distance r to it, T = s0·(r + u) (additive factoring: Luo & Qian
2012). Only u is differenced, which is 0 in the water and smooth elsewhere; ∇r is known. The upwind
neighbour of a node then has u − ∂r in place of T, and everything else is as in ``fast_sweeping``: vectorised
loops over diagonals of independent nodes. First-order sweeps, each over the quadrant that faces away from the
source, compute u; second-order sweeps over a slightly larger region correct it.

It is designed for tissue, whose slowness varies by tens of per cent, and for speed: lengths are in nodes,
slowness is relative to s0, and float32 resolves u to a few ten-thousandths of a node's crossing time.
"""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Float32s
from ..compilation.compiled import kernel
from ..compilation.float32 import lower
from .diagonals import FIRST, Diagonals, mirror, move

# First and last j, first and last k, counted from 1.
Box = tuple[int, int, int, int]

ZERO, HALF, ONE, TWO = (np.float32(x) for x in (0.0, 0.5, 1.0, 2.0))
THIRD, TWO_THIRDS, NINE_QUARTERS = (np.float32(x) for x in (1 / 3, 2 / 3, 9 / 4))

# Reciprocals of the sum of two squared weights, each 9/4 or 1: a division would take as long as all the rest.
FOUR_18THS, FOUR_13THS = np.float32(4 / 18), np.float32(4 / 13)

# u of an unknown node: later than any front, in crossing times of a node.
UNKNOWN = np.float32(1e6)

# Nodes this near to the source get the times of straight lines.
SEEDED = np.float32(2.0)

# Added to the square of a distance before division.
TINY = np.float32(1e-12)

# Second differences of u above this are a kink, at which first order is more accurate.
KINK = np.float32(0.25)

# Rows beyond the source in first-order sweeps of a quadrant, and fraction of the grid for second order.
BEYOND = 2
PART = 8

# Second-order sweeps continue while one changes a node by more than this fraction of its crossing time, for
# at most so many rounds; two rounds are restricted by ``PART``, the others cover the grid. In tissue one
# suffices.
SETTLED = np.float32(0.5)
ROUNDS = 8


class SweepArrays(NamedTuple):
    """The arrays of the sweeps, stored by diagonals; [0] the original grid, [1] with j flipped.

    Attributes:
        deviation: u.
        slope_j, slope_k: ∇r.
        crossing: slowness.
        shape, stored: as in ``Diagonals``.
    """

    deviation: Float32s
    slope_j: Float32s
    slope_k: Float32s
    crossing: Float32s
    shape: tuple[int, int, int]
    stored: tuple[int, int]


def allocate_sweep_arrays(shape: tuple[int, ...]) -> SweepArrays:
    """Allocate the arrays for grids of that shape; used again for every solve."""
    grid = Diagonals.from_shape(shape)
    u, slope_j, slope_k, crossing = np.full((4, 2, grid.size), UNKNOWN, np.float32)
    return SweepArrays(u, slope_j, slope_k, crossing, grid.shape, grid.stored)


@kernel
def deviate(slowness: Float32s, j: float, k: float, at: SweepArrays, out: Float32s) -> None:
    """Fill ``out`` (nodes,) with u from a source at (j, k), nodes.

    Args:
        slowness: (nodes,), 1 at the source.
        at: from ``allocate_sweep_arrays``.
    """
    _, nj, nk = at.shape
    for side in range(2):
        move(slowness, at.crossing[side], at.shape, at.stored, side == 1, np.float32(1.0), False, False)
        _fill_directions(np.float32(j if side == 0 else nj - 1 - j), np.float32(k), side, at)
        _fix_source(slowness, np.float32(j), np.float32(k), side, at)
    moved = 1
    for sweeps in range(ROUNDS + 1):
        if not moved:
            break
        moved = 0
        margin = BEYOND if sweeps == 0 else max(nj, nk) // PART
        if sweeps > 2:
            margin = max(nj, nk)
        low_k, high_k = max(1, int(k) + 1 - margin), min(nk, int(k) + 2 + margin)
        for side in range(2):
            middle = int(j) + 1 if side == 0 else nj - 1 - int(j)
            low_j, high_j = max(1, middle - margin), min(nj, middle + 1 + margin)
            for way in (1, -1):
                box = (low_j, nj, low_k, nk) if way > 0 else (1, high_j, 1, high_k)
                if sweeps == 0:
                    _sweep_first_order(box, way, side, at)
                    moved = 1
                else:
                    moved |= _sweep_second_order(box, way, side, at)
            if side == 0 or sweeps < ROUNDS:
                mirror(at.deviation[side], at.deviation[1 - side], at.shape, at.stored)
    move(out, at.deviation[0], at.shape, at.stored, False, np.float32(1.0), False, True)


@kernel
def _fill_directions(j: np.float32, k: np.float32, side: int, at: SweepArrays) -> None:
    """Fill ∇r, and u with the value of unknown nodes."""
    _, nj, nk = at.shape
    rows, width = at.stored
    u, slope_j, slope_k = at.deviation[side], at.slope_j[side], at.slope_k[side]
    for s in range(2, nj + nk + 1):
        first = max(1, s - nj)
        here = np.uint64(s % rows * width + first + FIRST - 1)
        off_j, off_k = np.float32(s - first - 1) - j, np.float32(first - 1) - k
        for x in range(np.uint64(min(nk, s - 1) - first + 1)):
            step = np.float32(np.int32(x))
            along, across = off_j - step, off_k + step
            inverse = ONE / np.sqrt(along * along + across * across + TINY)
            slope_j[here + x] = along * inverse
            slope_k[here + x] = across * inverse
            u[here + x] = UNKNOWN


@kernel
def _fix_source(slowness: Float32s, j: np.float32, k: np.float32, side: int, at: SweepArrays) -> None:
    """Fixed u around the source, from the mean slowness of both ends; ∇r, which is singular there, is NaN.

    Comparisons with NaN are false, so that sweeps do not change such a node.
    """
    _, nj, nk = at.shape
    rows, width = at.stored
    reach = int(SEEDED)
    for a in range(max(0, int(j) + 1 - reach), min(nj, int(j) + 1 + reach)):
        for b in range(max(0, int(k) + 1 - reach), min(nk, int(k) + 1 + reach)):
            distance = np.float32(math.sqrt((np.float32(a) - j) ** 2 + (np.float32(b) - k) ** 2))
            row = a if side == 0 else nj - 1 - a
            node = (row + b + 2) % rows * width + b + FIRST
            at.deviation[side, node] = HALF * (slowness[a * nk + b] - ONE) * distance
            at.slope_j[side, node] = at.slope_k[side, node] = np.float32(math.nan)


@kernel
def _sweep_first_order(box: Box, way: int, side: int, at: SweepArrays) -> None:
    """One first-order sweep: as ``fast_sweeping``, from neighbours at u ∓ ∂r."""
    u, slope_j, slope_k, crossing = at.deviation[side], at.slope_j[side], at.slope_k[side], at.crossing[side]
    rows, width = at.stored
    low, high = box[0] + box[2], box[1] + box[3]
    for turned in range(low, high + 1):
        s = turned if way > 0 else low + high - turned
        first = max(box[2], s - box[1])
        column = first + FIRST - 1
        here = np.uint64(s % rows * width + column)
        before = np.uint64((s - 1) % rows * width + column - 1)
        after = np.uint64((s + 1) % rows * width + column)
        for x in range(np.uint64(min(box[3], s - box[0]) - first + 1)):
            along, across, rhs = slope_j[here + x], slope_k[here + x], crossing[here + x]
            a = lower(u[before + x + np.uint64(1)] - along, u[after + x] + along)
            b = lower(u[before + x] - across, u[after + x + np.uint64(1)] + across)
            gap = lower(abs(a - b), rhs)
            new = lower(a, b) + HALF * (gap + np.sqrt(TWO * rhs * rhs - gap * gap))
            u[here + x] = lower(new, u[here + x])


@kernel
def _sweep_second_order(box: Box, way: int, side: int, at: SweepArrays) -> int:
    """One sweep of second order; returns 1 if a node moved by more than ``SETTLED``, else 0.

    Along each axis α·(u − base) with α = 3/2 and base = (4u1 − u2)/3 ∓ ⅔·∂r, or first order at kinks; then
    Σ α²·(u − base)² = s², or the earlier of the axes alone where that root lies before a base.
    """
    u, slope_j, slope_k, crossing = at.deviation[side], at.slope_j[side], at.slope_k[side], at.crossing[side]
    rows, width = at.stored
    low, high = box[0] + box[2], box[1] + box[3]
    one, two = np.uint64(1), np.uint64(2)
    moved = np.int32(0)
    for turned in range(low, high + 1):
        s = turned if way > 0 else low + high - turned
        first = max(box[2], s - box[1])
        column = first + FIRST - 1
        here = np.uint64(s % rows * width + column)
        before = np.uint64((s - 1) % rows * width + column - 1)
        after = np.uint64((s + 1) % rows * width + column)
        before_2 = np.uint64((s - 2) % rows * width + column - 2)
        after_2 = np.uint64((s + 2) % rows * width + column)
        for x in range(np.uint64(min(box[3], s - box[0]) - first + 1)):
            along, across, rhs, old = (
                slope_j[here + x],
                slope_k[here + x],
                crossing[here + x],
                u[here + x],
            )
            # All loads precede the selections: otherwise the loop is not vectorised.
            down, down_2 = u[before + x + one], u[before_2 + x + two]
            up, up_2 = u[after + x], u[after_2 + x]
            left, left_2 = u[before + x], u[before_2 + x]
            right, right_2 = u[after + x + one], u[after_2 + x + two]
            falls = down - along < up + along
            near, far = down if falls else up, down_2 if falls else up_2
            base_a, smooth_a = _base(old, near, far, -along if falls else along)
            falls = left - across < right + across
            near, far = left if falls else right, left_2 if falls else right_2
            base_b, smooth_b = _base(old, near, far, -across if falls else across)
            square_a, square_b = NINE_QUARTERS if smooth_a else ONE, NINE_QUARTERS if smooth_b else ONE
            both = square_a + square_b
            share = (
                (FOUR_18THS if smooth_b else FOUR_13THS) if smooth_a else (FOUR_13THS if smooth_b else HALF)
            )
            gap = base_a - base_b
            root = both * rhs * rhs - square_a * square_b * gap * gap
            joint = square_a * base_a + square_b * base_b + np.sqrt(root if root > ZERO else ZERO)
            joint = joint * share
            single = lower(
                base_a + (TWO_THIRDS * rhs if smooth_a else rhs),
                base_b + (TWO_THIRDS * rhs if smooth_b else rhs),
            )
            latest = base_a if base_a > base_b else base_b
            new = joint if (root > ZERO) & (joint >= latest) else single
            # Corrections are small; large ones come from margin the border.
            new = new if new < old + ONE else old
            moved |= np.int32(1) if abs(new - old) > SETTLED * rhs else np.int32(0)
            u[here + x] = new
    return int(moved)


@kernel(inline="always")
def _base(
    old: np.float32, near: np.float32, far: np.float32, slope: np.float32
) -> tuple[np.float32, np.bool_]:
    """Base of the upwind difference along an axis, and whether it is of second order."""
    fall = near - far
    smooth = abs(fall - (old - near)) < TWO * KINK
    second = near + fall * THIRD + slope * TWO_THIRDS
    return (second if smooth else near + slope), smooth

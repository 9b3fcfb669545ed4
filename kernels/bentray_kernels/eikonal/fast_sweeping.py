"""Fast sweeping: first-order Gauss–Seidel in the alternating orders (Zhao 2005; chapter 7.2.2).

The nodes of a diagonal are independent of each other in a sweep, so whole vectors of them are updated at once
(see ``diagonals``). A node is updated only after a neighbour has received an earlier time (locking: Bak,
McLaughlin & Renzi 2010); skipped updates would change nothing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import kernel
from ..errors import InvalidInput
from ..float32 import higher, lower
from .diagonals import FIRST, NONE, RUN, Columns, Diagonals, include
from .problem import PointSource

# First and last changed node of a run; first and last node whose change affects the nodes of the previous
# diagonal, then of the previous plane; whether a change exceeds the tolerance.
Outcome = tuple[int, int, int, int, int, int, int]


class Grid(NamedTuple):
    """What a sweep reads and changes, stored by diagonals.

    Attributes:
        time: s; changed in place.
        crossing: slowness times spacing of each node, s.
        waiting: nodes to update.
        changed: nodes that a sweep has changed.
        shape, stored: as in ``Diagonals``.
    """

    time: Floats
    crossing: Floats
    waiting: Columns
    changed: Columns
    shape: tuple[int, int, int]
    stored: tuple[int, int]


def fast_sweeping(problem: PointSource, *, tolerance: float = 1e-12) -> Floats:
    """Travel time by sweeps in all 4 (2-D) or 8 (3-D) orders until nothing changes.

    Args:
        problem: the checked problem.
        tolerance: sweeps in all orders that lower no time by more than this part of a node's own
            crossing time end the iteration.

    Returns:
        (nx, ny[, nz]), s; equal to first-order fast marching up to the tolerance.

    Raises:
        InvalidInput: for a negative tolerance.
    """
    times = np.empty((1, *problem.slowness.shape))
    fast_sweeping_many([problem], times, tolerance=tolerance)
    return np.asarray(times[0])


def fast_sweeping_many(problems: Iterable[PointSource], times: Floats, *, tolerance: float = 1e-12) -> None:
    """As ``fast_sweeping`` for problems of one shape, in the same working arrays one after the other.

    Sixteen solves in lockstep, one vector lane each, took twice the time at 256²: their arrays do not fit the
    cache, and no lane can skip updates that another one needs.

    Args:
        problems: as many as the batch of ``times``.
        times: (batch, nx, ny[, nz]), s, C order; filled.
        tolerance: as for ``fast_sweeping``.
    """
    if not tolerance >= 0.0:
        raise InvalidInput("tolerance", tolerance, "a number >= 0")
    sweeper = Sweeper(times.shape[1:])
    for problem, into in zip(problems, times, strict=True):
        sweeper.solve(problem, tolerance, into)


class Sweeper:
    """The arrays of sweeps over grids of one shape, used again for every solve."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._grid = Diagonals.of(shape)
        self._sweep = _sweep_3d if len(shape) == 3 else _sweep_2d
        # One block: the allocator keeps freed blocks of this size, and returns smaller ones to the system.
        arrays = np.empty((5, self._grid.size))
        arrays[:3].fill(-math.inf)
        arrays[3:].fill(math.inf)
        self._times = arrays[0], arrays[1]
        self._unknown = arrays[2]
        self._grid.store(np.full(math.prod(n + 2 for n in shape), math.inf), self._unknown, False)
        self._crossings = arrays[3], arrays[4]
        # Nodes waiting for an update, in either grid, and nodes changed by the last sweeps.
        self._waiting = self._grid.no_columns(), self._grid.no_columns()
        self._changed = self._grid.no_columns()
        # Slowness and spacing of the stored crossing times, in the original and in the flipped grid.
        self._stored: list[tuple[Floats, float] | None] = [None, None]

    def solve(self, problem: PointSource, tolerance: float, into: Floats) -> None:
        """Travel time of a problem of this shape, s, written into (nx, ny[, nz]) in C order."""
        np.copyto(self._times[0], self._unknown)
        seeds, times = problem.seeds()
        self._grid.put(seeds, times, self._times[0])
        side = self._until_settled(problem.slowness, problem.spacing, tolerance, seeds)
        self._grid.load(into.reshape(-1), self._times[side], side == 1, border=False)

    def settle(self, time: Floats, slowness: Floats, spacing: float, tolerance: float, nodes: Ints) -> None:
        """Sweep ``time`` in place until it has converged; its border holds the times outside.

        Args:
            time: flat and padded, s; infinity where unknown.
            slowness: (nx, ny[, nz]), s/m, C order.
            spacing: node spacing, m.
            tolerance: as for ``fast_sweeping``.
            nodes: flat padded indices of the nodes whose neighbours are updated first.
        """
        self._grid.store(time, self._times[0], False)
        side = self._until_settled(slowness, spacing, tolerance, nodes)
        self._grid.load(time, self._times[side], side == 1)

    def _until_settled(self, slowness: Floats, spacing: float, tolerance: float, nodes: Ints) -> int:
        """Sweep until no node is waiting; returns which of the two grids holds the times."""
        grid = self._grid
        grid.neighbours(nodes, self._waiting[0])
        quiet = 0
        for turns in itertools.count():
            side = turns % 2
            here, there = self._times[side], self._times[1 - side]
            waiting = self._waiting[side]
            self._changed.clear()
            crossing = self._crossing(side, slowness, spacing)
            moved = self._sweep(
                Grid(here, crossing, waiting, self._changed, grid.shape, grid.stored), tolerance
            )
            quiet = 0 if moved else quiet + 1
            if quiet == 2 or not waiting.any():
                return side
            if turns == 0:
                grid.turn(here, there)
            else:
                grid.turn_changed(here, there, self._changed)
            grid.flip(waiting, self._waiting[1 - side])
        raise AssertionError

    def _crossing(self, side: int, slowness: Floats, spacing: float) -> Floats:
        """Crossing times of the nodes by diagonals; those of the last solve if they are the same."""
        stored = self._stored[side]
        if (
            stored is None
            or stored[1] != spacing
            or not (stored[0] is slowness or np.array_equal(stored[0], slowness))
        ):
            self._grid.store(
                slowness.reshape(-1), self._crossings[side], side == 1, scale=spacing, border=False
            )
        self._stored[side] = slowness, spacing
        crossing: Floats = self._crossings[side]
        return crossing


@kernel
def _sweep_2d(grid: Grid, tolerance: float) -> int:
    moved = 0
    for way in (1, -1):
        moved |= _sweep_plane(grid, tolerance, 0, way, 0)
    return moved


@kernel
def _sweep_3d(grid: Grid, tolerance: float) -> int:
    moved = 0
    for up in (1, -1):
        for step in range(grid.shape[0]):
            plane = 2 + step if up > 0 else grid.shape[0] + 1 - step
            # Both orders while the plane is in the cache.
            for way in (1, -1):
                moved |= _sweep_plane(grid, tolerance, plane, way, up)
    return moved


@kernel
def _sweep_plane(grid: Grid, tolerance: float, plane: int, way: int, up: int) -> int:
    """Update the waiting diagonals of a plane, in rising (``way`` 1) or falling (−1) order.

    Columns that change are added to ``grid.changed``, their later neighbours to ``grid.waiting``.
    """
    time, crossing, shape = grid.time, grid.crossing, grid.shape
    low, high = grid.waiting
    lowest, highest = grid.changed
    _, nj, nk = shape
    rows, width = grid.stored
    base = plane * rows * width
    moved = 0
    for step in range(nj + nk - 1):
        s = 2 + step if way > 0 else nj + nk - step
        if low[plane, s] > high[plane, s]:
            continue
        start = (low[plane, s] - 1) // RUN * RUN
        count = (high[plane, s] - start + RUN - 1) // RUN * RUN
        low[plane, s] = NONE
        high[plane, s] = -1
        column = base + start + FIRST
        # Unsigned: with signed indices numba handles negative ones, and the loop is not vectorised.
        at = np.uint64(s % rows * width + column)
        before = np.uint64((s - 1) % rows * width + column - 1)
        after = np.uint64((s + 1) % rows * width + column)
        behind = np.uint64((s - 2 * way + rows) % rows * width + column - (2 if way > 0 else 0))
        # The planes below and above; without a third axis they are not read.
        here = s % rows * width + column
        below, above = np.uint64(here - up * rows * width), np.uint64(here + up * rows * width)
        beneath = np.uint64(here - 2 * up * rows * width)
        if up == 0:
            outcome = _relax(
                time, crossing, at, before, after, behind, below, above, beneath, count, tolerance, False
            )
        else:
            outcome = _relax(
                time, crossing, at, before, after, behind, below, above, beneath, count, tolerance, True
            )
        first, last, first_behind, last_behind, first_below, last_below, more = outcome
        moved |= more
        k = start + 1
        if last >= 0:
            include(lowest, highest, plane, s, k + first, k + last, shape)
            # Neighbours before have the same column or the next lower one, those after the next higher one.
            include(low, high, plane, s + way, k + first + min(way, 0), k + last + max(way, 0), shape)
            if up != 0 and 2 <= plane + up <= shape[0] + 1:
                include(low, high, plane + up, s, k + first, k + last, shape)
        if last_behind >= 0:
            include(
                low,
                high,
                plane,
                s - way,
                k + first_behind - max(way, 0),
                k + last_behind - min(way, 0),
                shape,
            )
        if last_below >= 0 and 2 <= plane - up <= shape[0] + 1:
            include(low, high, plane - up, s, k + first_below, k + last_below, shape)
    return moved


@kernel(inline="always")
def _relax(
    time: Floats,
    crossing: Floats,
    at: np.uint64,
    before: np.uint64,
    after: np.uint64,
    behind: np.uint64,
    below: np.uint64,
    above: np.uint64,
    beneath: np.uint64,
    count: int,
    tolerance: float,
    three_axes: bool,
) -> Outcome:
    """First-order time of ``count`` nodes from the earlier neighbour of each axis (Zhao 2005, equation 2.4).

    Three axes are added in order of time while they are upwind; ``three_axes`` is a constant. Without
    branches, so that it is vectorised: a difference clamped to the crossing time gives the time along one
    axis exactly, and where both are infinite the NaN compares as no improvement.
    """
    first, last, first_behind, last_behind, moved = NONE, -1, NONE, -1, 0
    first_below, last_below = NONE, -1
    for x in range(np.uint64(count)):
        a = lower(time[before + x], time[after + x + np.uint64(1)])
        b = lower(time[before + x + np.uint64(1)], time[after + x])
        rhs = crossing[at + x]
        if three_axes:
            square = rhs * rhs
            c = lower(time[below + x], time[above + x])
            less = lower(a, b)
            more = higher(a, b)
            low = lower(less, c)
            high = higher(more, c)
            middle = higher(less, lower(more, c))
            near = lower(middle - low, rhs)
            time_2 = 0.5 * (near + math.sqrt(2.0 * square - near * near))
            far = high - low
            total = near + far
            time_3 = (total + math.sqrt(total * total - 3.0 * (near * near + far * far - square))) / 3.0
            new = low + (time_3 if time_2 > far else time_2)
        else:
            gap = lower(abs(a - b), rhs)
            new = lower(a, b) + 0.5 * (gap + math.sqrt(2.0 * rhs * rhs - gap * gap))
        old = time[at + x]
        changed = new < old
        # A neighbour that has an earlier time from its other side does not improve.
        affected = changed & (new < higher(time[behind + x], time[behind + x + np.uint64(2)]))
        place = int(np.int64(x))
        first = min(first, place if changed else NONE)
        last = max(last, place if changed else -1)
        first_behind = min(first_behind, place if affected else NONE)
        last_behind = max(last_behind, place if affected else -1)
        if three_axes:
            affected_below = changed & (new < time[beneath + x])
            first_below = min(first_below, place if affected_below else NONE)
            last_below = max(last_below, place if affected_below else -1)
        moved |= 1 if old - new > tolerance * rhs else 0
        time[at + x] = new if changed else old
    return first, last, first_behind, last_behind, first_below, last_below, moved

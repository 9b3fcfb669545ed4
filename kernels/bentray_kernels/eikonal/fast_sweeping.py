"""Fast sweeping: first-order Gauss–Seidel in the alternating orders (Zhao 2005; chapter 7.2.2).

The nodes of a diagonal are independent of each other in a sweep, so whole vectors of them are updated at once
(see ``diagonals``). A node is updated only after a neighbour has received an earlier time (locking: Bak,
McLaughlin & Renzi 2010); skipped updates would change nothing.

In space several threads can share a solve. In a sweep, as soon as some diagonals of a block of planes are
done, the next block may follow on them; the grids are filled and copied in groups of planes.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..compilation.atomics import add, wait_for
from ..compilation.compiled import kernel
from ..compilation.float32 import higher, lower
from ..compilation.thread_team import SINGLE_THREAD, ThreadTeam, thread_team
from ..errors import InvalidInput
from .diagonals import FIRST, NONE, RUN, Columns, Diagonals, include
from .problem import PointSource, check_tolerance

MOST_THREADS = 64

# Planes of a block that a thread sweeps, and diagonals by which the next thread follows.
PLANES, STEPS = 8, 32

# Counters this far apart lie in cache lines of their own.
PROGRESS = 8

# Orders of planes and of diagonals; the other four are those of the grid with flipped j.
ORDERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))

# First and last changed node of a run; first and last node whose change affects the nodes of the previous
# diagonal, then of the previous plane; whether a change exceeds the tolerance.
Outcome = tuple[int, int, int, int, int, int, int]


class Grid(NamedTuple):
    """Arrays that a sweep reads and changes, stored by diagonals.

    Attributes:
        time: s; changed in place.
        crossing: slowness times spacing of each node, s.
        active_in_plane: nodes to update because of a neighbour in their plane.
        active_across_planes: nodes to update because of a neighbour in another plane.
        changed: nodes that a sweep has changed.
        shape, stored: as in ``Diagonals``.
    """

    time: Floats
    crossing: Floats
    active_in_plane: Columns
    active_across_planes: Columns
    changed: Columns
    shape: tuple[int, int, int]
    stored: tuple[int, int]


def fast_sweeping(
    problems: Iterable[PointSource], times: Floats, *, tolerance: float = 1e-12, threads: int = 1
) -> None:
    """Travel times by sweeps in all 4 (2-D) or 8 (3-D) orders until nothing changes.

    The problems are solved one after the other in the same working arrays. Sixteen solves in lockstep, one
    vector lane each, took twice the time at 256²: their arrays do not fit the cache, and no lane can skip
    updates that another one needs.

    Args:
        problems: as many checked problems of one shape as the batch of ``times``.
        times: (batch, nx, ny[, nz]), s, C order; filled, equal to first-order fast marching up to the
            tolerance.
        tolerance: sweeps in all orders that lower no time by more than this part of a node's own
            crossing time end the iteration.
        threads: that share a 3-D grid; a 2-D grid is swept by one. From 2 on their number does not change
            the result; that of 1, in an order that reads the memory half as often, is equal up to the
            tolerance.

    Raises:
        InvalidInput: for a negative tolerance, or threads that are no whole number from 1 to 64.
    """
    check_options(tolerance, threads)
    shape = times.shape[1:]
    with thread_team(threads if len(shape) == 3 else 1) as team:
        sweeper = Sweeper(shape, team)
        for problem, into in zip(problems, times, strict=True):
            sweeper.solve(problem, tolerance, into)


def check_options(tolerance: float, threads: int) -> None:
    """Raise ``InvalidInput`` for options that sweeps do not accept."""
    check_tolerance(tolerance)
    if isinstance(threads, bool) or threads not in range(1, MOST_THREADS + 1):
        raise InvalidInput("threads", threads, f"a whole number from 1 to {MOST_THREADS}")


class Sweeper:
    """The arrays of sweeps over grids of one shape, used again for every solve.

    A solve is ``start``, ``sweep_until_converged``, and for each arrival of earlier times ``lower_times`` and
    ``sweep_until_converged``.
    """

    def __init__(self, shape: tuple[int, ...], team: ThreadTeam = SINGLE_THREAD) -> None:
        self._grid = Diagonals.from_shape(shape)
        self._team = team
        # One block: the allocator keeps freed blocks of this size, and returns smaller ones to the system.
        arrays = np.empty((5, self._grid.size))
        for number, array in enumerate(arrays):
            team.fill(array, -math.inf if number < 3 else math.inf)
        self._times = arrays[0], arrays[1]
        self._unknown = arrays[2]
        unknown = np.empty(math.prod(n + 2 for n in shape))
        team.fill(unknown, math.inf)
        self._grid.copy(unknown, self._unknown, False, team=team)
        self._crossings = arrays[3], arrays[4]
        # Nodes to update, in either grid, and nodes changed by the last sweeps.
        self._active_in_plane = self._grid.empty_ranges(), self._grid.empty_ranges()
        self._active_across_planes = self._grid.empty_ranges(), self._grid.empty_ranges()
        self._changed = self._grid.empty_ranges()
        # Which grid holds the times, and whether the other one differs by the changed nodes alone.
        self._side, self._equal = 0, False
        # Slowness and spacing of the stored crossing times, in the original and in the flipped grid.
        self._stored: list[tuple[Floats, float] | None] = [None, None]

    @property
    def nbytes(self) -> int:
        """Memory of the arrays of nodes, bytes."""
        return 5 * int(self._unknown.nbytes)

    def solve(self, problem: PointSource, tolerance: float, into: Floats) -> None:
        """Travel time of a problem of this shape, s, written into (nx, ny[, nz]) in C order."""
        self.start(*problem.seeds())
        self.sweep_until_converged(problem.slowness, problem.spacing, tolerance)
        self.load(into)

    def start(self, nodes: Ints, times: Floats) -> None:
        """Begin a solve, in which only the times of some nodes are known.

        Args:
            nodes: flat indices in the grid padded by one node on each side; those of the padding are never
                updated.
            times: of these nodes, s.
        """
        self._team.copy(self._unknown, self._times[0])
        self._forget()
        self._put(nodes, times)

    def restart_from(self, times: Floats) -> None:
        """Begin with the times of all nodes, (nx, ny[, nz]), s, after sweeps that have ended."""
        padded = np.full(tuple(n + 2 for n in times.shape), math.inf)
        padded[(slice(1, -1),) * times.ndim] = times
        self._grid.copy(padded.ravel(), self._times[0], False, team=self._team)
        self._forget()

    def _forget(self) -> None:
        """The times are in the first grid, and no node is active."""
        self._side, self._equal = 0, False
        self._active_in_plane[0].clear()
        self._active_across_planes[0].clear()

    def lower_times(self, nodes: Ints, times: Floats) -> None:
        """Go on from the present times with earlier ones of some nodes; as ``start``."""
        grid, side = self._grid, self._side
        if self._equal:
            grid.mirror(self._times[side], self._times[1 - side], self._team, self._changed)
        if side == 1:
            grid.mirror_mask(self._active_in_plane[1], self._active_in_plane[0], self._team)
            grid.mirror_mask(self._active_across_planes[1], self._active_across_planes[0], self._team)
        self._changed.clear()
        self._side = 0
        self._put(nodes, times)

    def sweep_until_converged(self, slowness: Floats, spacing: float, tolerance: float) -> None:
        """Sweep until no node is active.

        Args:
            slowness: (nx, ny[, nz]), s/m, C order.
            spacing: node spacing, m.
            tolerance: as for ``fast_sweeping``.
        """
        grid, team = self._grid, self._team
        quiet = 0
        while True:
            side = self._side
            here, there = self._times[side], self._times[1 - side]
            active_in_plane, across = self._active_in_plane[side], self._active_across_planes[side]
            self._changed.clear()
            crossing = self._crossing(side, slowness, spacing)
            swept = Grid(here, crossing, active_in_plane, across, self._changed, grid.shape, grid.stored)
            quiet = 0 if self._sweep(swept, tolerance) else quiet + 1
            if quiet == 2 or not (active_in_plane.any() or across.any()):
                return
            grid.mirror(here, there, team, self._changed if self._equal else None)
            self._equal = True
            grid.mirror_mask(active_in_plane, self._active_in_plane[1 - side], team)
            grid.mirror_mask(across, self._active_across_planes[1 - side], team)
            self._side = 1 - side

    def load(self, into: Floats, *, border: bool = False) -> None:
        """Write the times, s, into a C-ordered array (nx, ny[, nz]), or into a padded one with ``border``."""
        times, flipped = self._times[self._side], self._side == 1
        self._grid.copy(into.reshape(-1), times, flipped, border=border, back=True, team=self._team)

    def times_at(self, nodes: Ints) -> Floats:
        """Times of flat padded ``nodes``, s."""
        return self._grid.take(nodes, self._times[self._side], self._side == 1)

    def _put(self, nodes: Ints, times: Floats) -> None:
        self._grid.put(nodes, times, self._times[0])
        if self._equal:
            self._grid.put(nodes, times, self._times[1], True)
        self._grid.include_neighbours(nodes, self._active_in_plane[0])

    def _sweep(self, grid: Grid, tolerance: float) -> int:
        """Whether a sweep in all orders of one of the two grids lowered a time by more than the tolerance."""
        threads, at_once = self._team.threads, self._team.at_once
        if not grid.shape[0]:
            return int(_sweep_2d(grid, tolerance))
        if threads == 1:
            return int(_sweep_3d(grid, tolerance))
        counters = np.zeros(PROGRESS * (2 + len(ORDERS) * -(-grid.shape[0] // PLANES)), np.int64)
        moved: int = max(at_once(lambda _: _share_sweeps(grid, tolerance, counters), range(threads)))
        return moved

    def _crossing(self, side: int, slowness: Floats, spacing: float) -> Floats:
        """Crossing times of the nodes by diagonals; those of the last solve if they are the same."""
        stored = self._stored[side]
        if (
            stored is None
            or stored[1] != spacing
            or not (stored[0] is slowness or np.array_equal(stored[0], slowness))
        ):
            plain, into = slowness.reshape(-1), self._crossings[side]
            self._grid.copy(plain, into, side == 1, scale=spacing, border=False, team=self._team)
        self._stored[side] = slowness, spacing
        crossing: Floats = self._crossings[side]
        return crossing


@kernel
def _sweep_2d(grid: Grid, tolerance: float) -> int:
    moved = 0
    for way in (1, -1):
        for step in range(grid.shape[1] + grid.shape[2] - 1):
            moved |= update_diagonal(grid, tolerance, 0, step, 0, way)
    return moved


@kernel
def _sweep_3d(grid: Grid, tolerance: float) -> int:
    planes, nj, nk = grid.shape
    moved = 0
    for up in (1, -1):
        for layer in range(planes):
            # Both orders while the plane is in the cache.
            for way in (1, -1):
                for step in range(nj + nk - 1):
                    moved |= update_diagonal(grid, tolerance, layer, step, up, way)
    return moved


@kernel
def _share_sweeps(grid: Grid, tolerance: float, counters: Ints) -> int:
    """The part of one thread of the sweeps in ``ORDERS``; any number of threads may join.

    A thread takes the next block of planes and follows the thread before it at a distance of some diagonals.
    All nodes are updated in the order of a sweep by one thread, up to nodes that do not affect each other.

    Args:
        counters: zeros: blocks taken, blocks done, then diagonals done of each block, ``PROGRESS`` apart.
    """
    planes, nj, nk = grid.shape
    blocks = (planes + PLANES - 1) // PLANES
    diagonals = nj + nk - 1
    moved = 0
    while True:
        number = add(counters, 0, 1)
        if number >= blocks * len(ORDERS):
            return moved
        up, way = ORDERS[number // blocks]
        block = number % blocks
        wait_for(counters, PROGRESS, number - block)
        own = PROGRESS * (2 + number)
        for first in range(0, diagonals, STEPS):
            if block > 0:
                wait_for(counters, own - PROGRESS, first + 1)
            for layer in range(block * PLANES, min(planes, (block + 1) * PLANES)):
                for step in range(first, min(diagonals, first + STEPS)):
                    moved |= update_diagonal(grid, tolerance, layer, step, up, way)
            add(counters, own, STEPS)
        add(counters, PROGRESS, 1)


@kernel(inline="always")
def update_diagonal(grid: Grid, tolerance: float, layer: int, step: int, up: int, way: int) -> int:
    """Update the active nodes of a diagonal of a plane, both counted in the order of the sweep.

    Nodes that change are added to ``grid.changed``, their later neighbours to ``grid.active_in_plane`` and
    ``grid.active_across_planes``. Those of other planes are kept apart, so that threads at adjacent planes
    never write to the same place.

    Args:
        up: 1 for planes in rising, -1 in falling order, 0 for a grid of two axes.
        way: 1 for diagonals in rising, -1 in falling order.
    """
    time, crossing, shape = grid.time, grid.crossing, grid.shape
    low, high = grid.active_in_plane
    low_across, high_across = grid.active_across_planes
    lowest, highest = grid.changed
    planes, nj, nk = shape
    plane = 0 if up == 0 else (2 + layer if up > 0 else planes + 1 - layer)
    s = 2 + step if way > 0 else nj + nk - step
    begin, end = min(low[plane, s], low_across[plane, s]), max(high[plane, s], high_across[plane, s])
    if begin > end:
        return 0
    low[plane, s] = low_across[plane, s] = NONE
    high[plane, s] = high_across[plane, s] = -1
    rows, width = grid.stored
    base = plane * rows * width
    start = (begin - 1) // RUN * RUN
    count = (end - start + RUN - 1) // RUN * RUN
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
    first, last, first_behind, last_behind, first_below, last_below, moved = outcome
    k = start + 1
    if last >= 0:
        include(lowest, highest, plane, s, k + first, k + last, shape)
        # Neighbours before have the same column or the next lower one, those after the next higher one.
        include(low, high, plane, s + way, k + first + min(way, 0), k + last + max(way, 0), shape)
        if up != 0 and 2 <= plane + up <= planes + 1:
            include(low_across, high_across, plane + up, s, k + first, k + last, shape)
    if last_behind >= 0:
        include(
            low, high, plane, s - way, k + first_behind - max(way, 0), k + last_behind - min(way, 0), shape
        )
    if last_below >= 0 and 2 <= plane - up <= planes + 1:
        include(low_across, high_across, plane - up, s, k + first_below, k + last_below, shape)
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

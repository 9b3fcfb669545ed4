"""Fast sweeping in all orders at the same time, each on a copy of the times (Zhao 2007; chapter 7.2.2).

An order does not see what the others have found in the same round, so that more rounds are needed, and every
round updates all nodes. It is the published way to use several cores; threads that share one sweep are
faster (``fast_sweeping``).
"""

import itertools
import math

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel
from ..compilation.thread_team import thread_team
from .diagonals import Columns, Diagonals
from .fast_sweeping import Grid, check_options, update_diagonal
from .problem import PointSource

# Which of the two grids (1: flipped j), order of the planes (0: none) and order of the diagonals.
Order = tuple[int, int, int]


def simultaneous_sweeps(problem: PointSource, *, tolerance: float = 1e-12, threads: int = 1) -> Floats:
    """Travel time by rounds of one sweep in each of the 4 (2-D) or 8 (3-D) orders.

    Args:
        problem: the checked problem.
        tolerance: as for ``fast_sweeping``.
        threads: that sweep at the same time, at most as many as orders. They do not change the result.

    Returns:
        (nx, ny[, nz]), s; equal to first-order fast marching up to the tolerance.

    Raises:
        InvalidInput: as ``fast_sweeping``.
    """
    check_options(tolerance, threads)
    shape = problem.slowness.shape
    grid = Diagonals.from_shape(shape)
    orders: list[Order] = list(itertools.product((0, 1), (1, -1) if len(shape) == 3 else (0,), (1, -1)))
    crossing, time = np.full((2, grid.size), math.inf), np.full((2, grid.size), -math.inf)
    for side in (0, 1):
        grid.copy(
            problem.slowness.reshape(-1), crossing[side], side == 1, scale=problem.spacing, border=False
        )
        grid.copy(np.full(math.prod(problem.padded_shape), math.inf), time[side], side == 1)
        grid.put(*problem.seeds(), time[side], side == 1)
    copies = np.empty((len(orders), grid.size))
    every = _all_columns(grid)

    def sweep(number: int) -> int:
        side, up, way = orders[number]
        copy = copies[number]
        np.copyto(copy, time[side])
        active_in_plane = Columns(every.low.copy(), every.high.copy())
        swept = Grid(
            copy,
            crossing[side],
            active_in_plane,
            grid.empty_ranges(),
            grid.empty_ranges(),
            grid.shape,
            grid.stored,
        )
        return int(_sweep_once(swept, tolerance, up, way))

    half = len(orders) // 2
    with thread_team(threads) as team:
        while any(list(team.at_once(sweep, range(len(orders))))):
            for side in (0, 1):
                np.minimum.reduce(copies[side * half : (side + 1) * half], out=time[side])
            grid.mirror(time[1], copies[0], team)
            np.minimum(time[0], copies[0], out=time[0])
            grid.mirror(time[0], time[1], team)
    times = np.empty(shape)
    grid.copy(times.reshape(-1), time[0], False, border=False, back=True)
    return times


def _all_columns(grid: Diagonals) -> Columns:
    """All nodes of a grid."""
    _, nj, nk = grid.shape
    every = grid.empty_ranges()
    s = np.arange(2, nj + nk + 1)
    planes = slice(2, -2) if grid.shape[0] else slice(None)
    every.low[planes, 2 : nj + nk + 1] = np.maximum(1, s - nj)
    every.high[planes, 2 : nj + nk + 1] = np.minimum(nk, s - 1)
    return every


@kernel
def _sweep_once(grid: Grid, tolerance: float, up: int, way: int) -> int:
    planes, nj, nk = grid.shape
    moved = 0
    for layer in range(max(planes, 1)):
        for step in range(nj + nk - 1):
            moved |= update_diagonal(grid, tolerance, layer, step, up, way)
    return moved

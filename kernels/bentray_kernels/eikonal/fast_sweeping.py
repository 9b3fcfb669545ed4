"""Fast sweeping: first-order Gauss–Seidel in the alternating orders (Zhao 2005; chapter 7.2.2)."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats
from ..compiled import kernel
from ..errors import InvalidInput
from .problem import PointSource
from .updates import first_order_2d, first_order_3d


def fast_sweeping(problem: PointSource, *, tolerance: float = 1e-12) -> Floats:
    """Travel time by sweeps in all 4 (2-D) or 8 (3-D) orders until nothing changes.

    Args:
        problem: the checked problem.
        tolerance: a round of sweeps that lowers no time by more than this part of a node's own
            crossing time ends the iteration.

    Returns:
        (nx, ny[, nz]), s; equal to first-order fast marching up to the tolerance.

    Raises:
        InvalidInput: for a negative tolerance.
    """
    if not tolerance >= 0.0:
        raise InvalidInput("tolerance", tolerance, "a number >= 0")
    return problem.interior(sweep_until_settled(problem, tolerance))


def sweep_until_settled(problem: PointSource, tolerance: float) -> Floats:
    """As ``fast_sweeping``, flat and with the border, for solvers that go on from there."""
    time = np.full(problem.padded_slowness.size, math.inf)
    seeds, times = problem.seeds()
    time[seeds] = times
    grid = time.reshape(problem.padded_shape)
    slowness = problem.padded_slowness.reshape(problem.padded_shape)
    if grid.ndim == 2:
        _sweep_2d(grid, slowness, problem.spacing, tolerance)
    else:
        _sweep_3d(grid, slowness, problem.spacing, tolerance)
    return time


@kernel
def _sweep_2d(time: Floats, slowness: Floats, spacing: float, tolerance: float) -> None:
    nx, ny = time.shape
    while True:
        changed = False
        for order in range(4):
            down_x = order & 1
            down_y = order >> 1
            for step_x in range(1, nx - 1):
                i = nx - 1 - step_x if down_x else step_x
                for step_y in range(1, ny - 1):
                    j = ny - 1 - step_y if down_y else step_y
                    a = min(time[i - 1, j], time[i + 1, j])
                    b = min(time[i, j - 1], time[i, j + 1])
                    old = time[i, j]
                    # A node earlier than both its axes is settled already: nothing can lower it.
                    if a >= old and b >= old:
                        continue
                    crossing = spacing * slowness[i, j]
                    new = first_order_2d(a, b, crossing)
                    if new < old:
                        time[i, j] = new
                        changed = changed or old - new > tolerance * crossing
        if not changed:
            return


@kernel
def _sweep_3d(time: Floats, slowness: Floats, spacing: float, tolerance: float) -> None:
    nx, ny, nz = time.shape
    while True:
        changed = False
        for order in range(8):
            down_x = order & 1
            down_y = (order >> 1) & 1
            down_z = order >> 2
            for step_x in range(1, nx - 1):
                i = nx - 1 - step_x if down_x else step_x
                for step_y in range(1, ny - 1):
                    j = ny - 1 - step_y if down_y else step_y
                    for step_z in range(1, nz - 1):
                        k = nz - 1 - step_z if down_z else step_z
                        a = min(time[i - 1, j, k], time[i + 1, j, k])
                        b = min(time[i, j - 1, k], time[i, j + 1, k])
                        c = min(time[i, j, k - 1], time[i, j, k + 1])
                        old = time[i, j, k]
                        if a >= old and b >= old and c >= old:
                            continue
                        crossing = spacing * slowness[i, j, k]
                        new = first_order_3d(a, b, c, crossing)
                        if new < old:
                            time[i, j, k] = new
                            changed = changed or old - new > tolerance * crossing
        if not changed:
            return

"""The default solver: factored second order, without a heap, in the order of a cheaper solution."""

import math

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compilation.compiled import int64, kernel
from ..errors import InvalidInput
from ..splines import refined
from .fast_marching import high_accuracy_fast_marching
from .fast_sweeping import Sweeper
from .heap import DONE
from .out_of_order import (
    LENGTH,
    RESETS,
    SEED,
    WAIT,
    accept_earlier,
    correct,
    empty_waiting,
    wait,
)
from .problem import Factor, PointSource, SlownessGrid, Start, Strides
from .updates import TIE, Front, factored_update

# First-order times only give the order of arrival; they need not converge to rounding.
ORDER_TOLERANCE = 1e-3

# First-order times give a poor order near the source, which all later nodes inherit. Where the speed varies
# by no more than CONTRAST within RADIUS nodes, times along straight lines are used there.
RADIUS = 8
CONTRAST = 1.5

# Largest accepted refinement of the grid.
FINEST = 8


def accurate(problem: PointSource, *, supersample: int = 1) -> Floats:
    """Factored second-order travel time without a heap.

    Fast sweeping gives the order in which the front arrives, a counting sort puts the nodes into that
    order, and a pass of the update of ``hafmm`` follows it. Nodes that precede an earlier neighbour in that
    order are recomputed: see ``out_of_order``. So every node is later than its earliest
    neighbour, and the times are those of ``hafmm``, up to its own error where speeds differ tenfold.

    Args:
        problem: the checked problem.
        supersample: the equation is solved on a grid this many times as fine, with the medium from its cubic
            spline: with 2 the error falls to about a quarter for four (2-D) or eight (3-D) times the work.

    Returns:
        (nx, ny[, nz]), s.

    Raises:
        InvalidInput: for a ``supersample`` that is no whole number from 1 to 8.
    """
    if isinstance(supersample, bool) or supersample not in range(1, FINEST + 1):
        raise InvalidInput("supersample", supersample, f"a whole number from 1 to {FINEST}")
    if supersample > 1:
        every = (slice(None, None, supersample),) * problem.slowness.ndim
        return np.ascontiguousarray(accurate(_supersampled(problem, int(supersample)))[every])
    start = problem.start()
    nodes, times = problem.surroundings(RADIUS, CONTRAST) or (start.seeds, start.times)
    order = _by_arrival(_first_order(problem, nodes, times), problem.slowness.size)
    time, complete = _pass(order, start, problem.strides, problem.factor())
    return problem.interior(time) if complete else high_accuracy_fast_marching(problem)


def _supersampled(problem: PointSource, times: int) -> PointSource:
    """This source in the medium's cubic spline, which may overshoot but not leave the medium's range."""
    slowness = problem.slowness
    fine = np.clip(refined(slowness, times), slowness.min(), slowness.max())
    return PointSource(SlownessGrid(fine, problem.spacing / times), problem.source)


def _first_order(problem: PointSource, nodes: Ints, times: Floats) -> Floats:
    """First-order times from given ones, flat and padded, s."""
    sweeper = Sweeper(problem.slowness.shape)
    sweeper.start(nodes, times)
    sweeper.sweep_until_converged(problem.slowness, problem.spacing, ORDER_TOLERANCE)
    time = np.empty(problem.padded_slowness.size)
    sweeper.load(time, border=True)
    return time


@kernel
def _by_arrival(time: Floats, count: int) -> NDArray[np.int32]:
    """Indices of the ``count`` finite times in rising order: counting sort, then insertion."""
    last = 0.0
    for t in time:
        if t < math.inf and t > last:
            last = t
    buckets = count
    scale = (buckets - 1) / last if last > 0.0 else 0.0
    start = np.zeros(buckets + 1, np.int32)
    for t in time:
        if t < math.inf:
            start[int(t * scale) + 1] += 1
    for b in range(buckets):
        start[b + 1] += start[b]
    order = np.empty(count, np.int32)
    for node in range(time.size):
        if time[node] < math.inf:
            b = int(time[node] * scale)
            order[start[b]] = node
            start[b] += 1
    # Buckets hold about one node each, so this touches every node a few times at most.
    for k in range(1, count):
        node = order[k]
        t = time[node]
        hole = k
        while hole > 0 and time[order[hole - 1]] > t:
            order[hole] = order[hole - 1]
            hole -= 1
        order[hole] = node
    return order


@kernel
def _pass(order: NDArray[np.int32], start: Start, strides: Strides, factor: Factor) -> tuple[Floats, bool]:
    """Times of all nodes, and True; False where more nodes came out of order than there are."""
    slowness, spacing, seeds, seed_times = start
    squares, limit, least = factor
    # A constant 0 for the third of two axes lets the compiler drop its code.
    steps = (strides[0], strides[1], strides[2] if len(strides) == 3 else 0)
    settled = np.full(slowness.size, math.inf)
    tau = np.ones(slowness.size)
    front = Front(steps, spacing, slowness, squares, limit, least, tau, settled)
    waiting = empty_waiting(slowness.size)
    place, numbers = waiting.place, waiting.numbers
    for k in range(seeds.size):
        place[seeds[k]] = SEED
        settled[seeds[k]] = seed_times[k]
        if squares[seeds[k]] > 0.0:
            tau[seeds[k]] = seed_times[k] / math.sqrt(squares[seeds[k]])
    for listed in order:
        node = int64(listed)
        if settled[node] < math.inf or (numbers[WAIT] > 0 and place[node] > DONE):
            continue
        time = factored_update(node, front)
        if numbers[LENGTH] > 0:
            time = accept_earlier(node, time, front, waiting)
        if time == math.inf:
            # In the given order it precedes all of its neighbours.
            wait(node, waiting)
            continue
        settled[node] = time
        tau[node] = time / math.sqrt(squares[node])
        later = time * (1.0 + TIE)
        wrong = numbers[WAIT] > 0
        for axis in range(len(strides)):
            for neighbour in (node - steps[axis], node + steps[axis]):
                wrong |= later < settled[neighbour] < math.inf
        if wrong:
            correct(node, front, waiting)
            if numbers[RESETS] > slowness.size:
                return settled, False
    accept_earlier(-1, math.inf, front, waiting)
    return settled, numbers[RESETS] <= slowness.size

"""The default solver: one factored second-order pass in the order of a cheap first-order solution."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .fast_sweeping import sweep_until_settled
from .problem import Floats, PointSource
from .updates import factored_update, scratch

# The order of arrival is all that the first-order times are for; they need not settle to rounding.
ORDER_TOLERANCE = 1e-3


def accurate(problem: PointSource) -> Floats:
    """Factored second-order travel time without a heap.

    Fast sweeping gives the order in which the front arrives, a counting sort puts the nodes into
    that order, and one pass of the update of ``hafmm`` follows it. Where two fronts meet, an order
    that is wrong by less than the first-order error costs no more than that error at those nodes.

    Returns:
        (nx, ny[, nz]), s.
    """
    seeds, times = problem.seeds()
    source_slowness = problem.source_slowness()
    reference = source_slowness * problem.distance()
    rough = sweep_until_settled(problem, ORDER_TOLERANCE)
    time = _pass(
        _by_arrival(rough, problem.slowness.size),
        problem.padded_slowness,
        problem.strides,
        problem.spacing,
        problem.source,
        source_slowness,
        reference,
        seeds,
        times,
    )
    return problem.interior(time)


@njit(cache=True, nogil=True)
def _by_arrival(time, count):
    """Indices of the ``count`` finite times in rising order: counting sort, then insertion."""
    last = 0.0
    for t in time:
        if t < math.inf and t > last:
            last = t
    buckets = count
    scale = (buckets - 1) / last if last > 0.0 else 0.0
    start = np.zeros(buckets + 1, np.int64)
    for t in time:
        if t < math.inf:
            start[int(t * scale) + 1] += 1
    for b in range(buckets):
        start[b + 1] += start[b]
    order = np.empty(count, np.int64)
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


@njit(cache=True, nogil=True)
def _pass(order, slowness, strides, spacing, source, source_slowness, reference, seeds, seed_times):
    time = np.full(slowness.size, math.inf)
    tau = np.ones(slowness.size)
    accepted = np.zeros(slowness.size, np.bool_)
    slope, shift, newest = scratch(len(strides))
    offset_m = np.empty(len(strides))
    for k in range(seeds.size):
        time[seeds[k]] = seed_times[k]
    for node in order:
        rest = node
        for k in range(len(strides)):
            offset_m[k] = (rest // strides[k] - 1) * spacing - source[k]
            rest = rest % strides[k]
        if reference[node] > 0.0:
            trial = factored_update(
                node,
                strides,
                spacing,
                slowness,
                source_slowness,
                offset_m,
                reference,
                tau,
                time,
                accepted,
                slope,
                shift,
                newest,
            )
            time[node] = min(time[node], trial)
            tau[node] = time[node] / reference[node]
        accepted[node] = True
    return time

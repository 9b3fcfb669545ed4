"""Fast marching with an untidy queue: O(N) for a bounded error (Yatziv, Bartesaghi & Sapiro 2006)."""

import math

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from .heap import DONE, FAR, Nodes
from .problem import PointSource, Start, Strides
from .untidy_queue import enter, take
from .updates import TIE, plain_update

# Most buckets in the queue; media of high contrast get wider ones.
BUCKETS = 1 << 16


def fast_marching_untidy(problem: PointSource, *, order: int = 2, width: float = 0.01) -> Floats:
    """Like ``fast_marching``, but nodes of one bucket of times take the queue together.

    Args:
        problem: the checked problem.
        order: 1 or 2.
        width: bucket width as a fraction of the smallest crossing time, spacing times lowest slowness.

    Returns:
        (nx, ny[, nz]), s. At order 1 between the time T of ``fast_marching`` and T·(1 + δ·√ndim/f), with the
        bucket width δ and the smallest crossing time f. A node that leaves too early misses neighbours at
        most one bucket earlier, so its time is at most δ above its own update. The update grows with the
        crossing time at a rate of at least 1/√ndim: the time is no later than the exact one in a medium
        slower by this factor. At order 2, where an early node also changes between second- and first-order
        differences, the bound holds in smooth media.

    Raises:
        InvalidInput: for another order, or a width that is not above 0 and at most 1.
    """
    if order not in (1, 2):
        raise InvalidInput("order", order, "1 or 2")
    # A little narrower, so that equal times at a bucket edge, such as half a crossing, fall on one side.
    bucket = _bucket_width(problem, width) * (1.0 - TIE)
    # At order 1 no time in the queue exceeds the current one by more than a crossing time; twice as many
    # buckets serve the seeds, which lie in one cell, and order 2.
    buckets = int(2.0 * problem.spacing * problem.slowness.max() / bucket) + 3
    time = _march(problem.start(), problem.strides, problem.places(FAR, DONE), order == 2, bucket, buckets)
    return problem.interior(time)


def _bucket_width(problem: PointSource, width: float) -> float:
    """Width of a bucket, s."""
    if not 0.0 < width <= 1.0:
        raise InvalidInput("width", width, "a number above 0 and at most 1")
    slowness = problem.slowness
    return problem.spacing * max(width * float(slowness.min()), float(slowness.max()) / BUCKETS)


@kernel
def _march(
    start: Start, strides: Strides, place: Nodes, second_order: bool, width: float, buckets: int
) -> Floats:
    slowness, spacing, seeds, seed_times = start
    # A constant 0 for the third of two axes lets the compiler drop its code.
    steps = (strides[0], strides[1], strides[2] if len(strides) == 3 else 0)
    settled = np.full(slowness.size, math.inf)
    trials = np.full(slowness.size, math.inf)
    heads = np.zeros(buckets, np.int32)
    links = np.zeros((slowness.size, 2), np.int32)
    group = np.empty(slowness.size, np.int32)
    queued = 0
    for k in range(seeds.size):
        trials[seeds[k]] = seed_times[k]
        queued += enter(heads, links, place, width, seeds[k], seed_times[k])
    latest = seed_times.min()
    bucket = int(latest / width) % buckets
    while queued > 0:
        while heads[bucket] == 0:
            bucket = bucket + 1 if bucket + 1 < buckets else 0
        # Nodes of one bucket are accepted together, so that the order within it does not matter.
        members = 0
        while heads[bucket] != 0:
            node = take(heads, links, place, bucket)
            group[members] = node
            members += 1
            settled[node] = trials[node]
            latest = max(latest, trials[node])
        queued -= members
        for k in range(members):
            node = group[k]
            for axis in range(3):
                stride = steps[axis]
                for neighbour in (node - stride, node + stride):
                    if place[neighbour] == DONE:
                        continue
                    trial = plain_update(
                        neighbour, steps, spacing * slowness[neighbour], settled, second_order
                    )
                    if trial < trials[neighbour]:
                        trials[neighbour] = trial
                        # A second-order time may fall behind the bucket that was emptied.
                        queued += enter(heads, links, place, width, neighbour, max(trial, latest))
    return settled

"""Fast marching with a binary min-heap and back pointers, plain or factored (Sethian 1996; chapter 6.2.2)."""

import math

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from .heap import DONE, FAR, Nodes, pop_min, push_or_update
from .problem import Factor, PointSource, Start, Strides
from .updates import TIE, Front, factored_update, plain_update


def fast_marching(problem: PointSource, *, order: int = 2) -> Floats:
    """Travel time by one pass in order of arrival, O(N log N).

    Args:
        problem: the checked problem.
        order: of the differences, 1 or 2; second order falls back to first where a second neighbour is not
            upwind.

    Returns:
        (nx, ny[, nz]), s. The source's singularity adds an error near it that spreads along the rays: with
        differences of either order the error falls with the first power of the spacing; see ``hafmm``.

    Raises:
        InvalidInput: for another order.
    """
    if order not in (1, 2):
        raise InvalidInput("order", order, "1 or 2")
    return problem.interior(_march(problem.start(), problem.strides, problem.places(FAR, DONE), order == 2))


def high_accuracy_fast_marching(problem: PointSource) -> Floats:
    """Second-order fast marching that is accurate at the source too (HAFMM, chapter 6.2.2).

    The dissertation starts the second-order scheme from exact times around the source. Here the
    factor T/T0 is marched instead, which needs no start region: see ``updates.factored_update``.

    Args:
        problem: the checked problem.

    Returns:
        (nx, ny[, nz]), s.
    """
    places = problem.places(FAR, DONE)
    return problem.interior(_march_factored(problem.start(), problem.strides, places, problem.factor()))


@kernel
def _march(start: Start, strides: Strides, place: Nodes, second_order: bool) -> Floats:
    slowness, spacing, seeds, seed_times = start
    # A constant 0 for the third of two axes lets the compiler drop its code.
    steps = (strides[0], strides[1], strides[2] if len(strides) == 3 else 0)
    settled = np.full(slowness.size, math.inf)
    heap = np.empty(slowness.size, np.int32)
    keys = np.empty(slowness.size)
    group = np.empty(slowness.size, np.int32)
    length = 0
    for k in range(seeds.size):
        length = push_or_update(heap, keys, place, length, seeds[k], seed_times[k])
    while length > 0:
        # Nodes that tie are accepted together, or the second differences would depend on their order.
        latest = keys[0] * (1.0 + TIE)
        members = 0
        while length > 0 and keys[0] <= latest:
            group[members] = heap[0]
            members += 1
            settled[heap[0]] = keys[0]
            length = pop_min(heap, keys, place, length)
        for k in range(members):
            node = group[k]
            for axis in range(3):
                stride = steps[axis]
                for neighbour in (node - stride, node + stride):
                    here = place[neighbour]
                    if here == DONE:
                        continue
                    trial = plain_update(
                        neighbour, steps, spacing * slowness[neighbour], settled, second_order
                    )
                    if here == FAR or trial < keys[here]:
                        length = push_or_update(heap, keys, place, length, neighbour, trial)
    return settled


@kernel
def _march_factored(start: Start, strides: Strides, place: Nodes, factor: Factor) -> Floats:
    slowness, spacing, seeds, seed_times = start
    squares, limit, least = factor
    # A constant 0 for the third of two axes lets the compiler drop its code.
    steps = (strides[0], strides[1], strides[2] if len(strides) == 3 else 0)
    settled = np.full(slowness.size, math.inf)
    tau = np.ones(slowness.size)
    front = Front(steps, spacing, slowness, squares, limit, least, tau, settled)
    heap = np.empty(slowness.size, np.int32)
    keys = np.empty(slowness.size)
    group = np.empty(slowness.size, np.int32)
    length = 0
    # No difference is better than the straight lines from the source: the seeds' times are final.
    members = seeds.size
    for k in range(members):
        group[k] = seeds[k]
        settled[seeds[k]] = seed_times[k]
        place[seeds[k]] = DONE
        if squares[seeds[k]] > 0.0:
            tau[seeds[k]] = seed_times[k] / math.sqrt(squares[seeds[k]])
    while members > 0:
        for k in range(members):
            node = group[k]
            for axis in range(3):
                stride = steps[axis]
                for neighbour in (node - stride, node + stride):
                    if place[neighbour] == DONE:
                        continue
                    # A neighbour more can make the time later: it replaces what fewer neighbours gave.
                    trial = factored_update(neighbour, front)
                    length = push_or_update(heap, keys, place, length, neighbour, trial)
        # Nodes that tie are accepted together, or the second differences would depend on their order.
        latest = keys[0] * (1.0 + TIE)
        members = 0
        while length > 0 and keys[0] <= latest:
            node = heap[0]
            group[members] = node
            members += 1
            settled[node] = keys[0]
            tau[node] = keys[0] / math.sqrt(squares[node])
            length = pop_min(heap, keys, place, length)
    return settled

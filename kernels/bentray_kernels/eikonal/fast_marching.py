"""Fast marching with a binary min-heap and back pointers, plain or factored (Sethian 1996; chapter 6.2.2)."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import kernel
from ..errors import InvalidInput
from .problem import PointSource
from .updates import factored_update, plain_update, scratch

FAR = -1
DONE = -2


def fast_marching(problem: PointSource, *, order: int = 2) -> Floats:
    """Travel time by one pass in order of arrival, O(N log N).

    Args:
        problem: the checked problem.
        order: 1 or 2; second order falls back to first where a second neighbour is not upwind.

    Returns:
        (nx, ny[, nz]), s. The source's singularity limits the accuracy near it; see ``hafmm``.

    Raises:
        InvalidInput: for another order.
    """
    if order not in (1, 2):
        raise InvalidInput("order", order, "1 or 2")
    seeds, times = problem.seeds()
    time = _march(
        problem.padded_slowness,
        problem.padded_shape,
        problem.strides,
        problem.spacing,
        seeds,
        times,
        order == 2,
    )
    return problem.interior(time)


def high_accuracy_fast_marching(problem: PointSource) -> Floats:
    """Second-order fast marching that is accurate at the source too (HAFMM, chapter 6.2.2).

    The dissertation starts the second-order scheme from exact times around the source. Here the
    factor T/T0 is marched instead, which needs no start region: see ``updates.factored_update``.

    Returns:
        (nx, ny[, nz]), s.
    """
    seeds, times = problem.seeds()
    source_slowness = problem.source_slowness()
    reference = source_slowness * problem.distance()
    time = _march_factored(
        problem.padded_slowness,
        problem.padded_shape,
        problem.strides,
        problem.spacing,
        problem.source,
        source_slowness,
        reference,
        seeds,
        times,
    )
    return problem.interior(time)


@kernel
def _march(
    slowness: Floats,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    spacing: float,
    seeds: Ints,
    seed_times: Floats,
    second_order: bool,
) -> Floats:
    size = slowness.size
    time = np.full(size, math.inf)
    accepted = np.zeros(size, np.bool_)
    place = _places(shape)
    heap = np.empty(size, np.int64)
    times, weights, newest = scratch(len(strides))
    length = 0
    for k in range(seeds.size):
        length = _lower(heap, place, time, length, seeds[k], seed_times[k])
    while length > 0:
        node = heap[0]
        length = _pop(heap, place, time, length)
        accepted[node] = True
        for axis in range(len(strides)):
            for neighbour in (node - strides[axis], node + strides[axis]):
                if place[neighbour] == DONE:
                    continue
                trial = plain_update(
                    neighbour,
                    strides,
                    spacing,
                    slowness,
                    time,
                    accepted,
                    second_order,
                    times,
                    weights,
                    newest,
                )
                if trial < time[neighbour]:
                    length = _lower(heap, place, time, length, neighbour, trial)
    return time


@kernel
def _march_factored(
    slowness: Floats,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    spacing: float,
    source: Floats,
    source_slowness: float,
    reference: Floats,
    seeds: Ints,
    seed_times: Floats,
) -> Floats:
    size = slowness.size
    time = np.full(size, math.inf)
    tau = np.ones(size)
    accepted = np.zeros(size, np.bool_)
    place = _places(shape)
    heap = np.empty(size, np.int64)
    slope, shift, newest = scratch(len(strides))
    offset_m = np.empty(len(strides))
    length = 0
    for k in range(seeds.size):
        length = _lower(heap, place, time, length, seeds[k], seed_times[k])
    while length > 0:
        node = heap[0]
        length = _pop(heap, place, time, length)
        accepted[node] = True
        if reference[node] > 0.0:
            tau[node] = time[node] / reference[node]
        for axis in range(len(strides)):
            for neighbour in (node - strides[axis], node + strides[axis]):
                if place[neighbour] == DONE:
                    continue
                rest = neighbour
                for k in range(len(strides)):
                    offset_m[k] = (rest // strides[k] - 1) * spacing - source[k]
                    rest = rest % strides[k]
                trial = factored_update(
                    neighbour,
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
                if trial < time[neighbour]:
                    length = _lower(heap, place, time, length, neighbour, trial)
    return time


@kernel
def _places(shape: tuple[int, ...]) -> Ints:
    """Heap place of every node: FAR inside, DONE on the border so that the front never enters it."""
    place = np.full(shape, DONE)
    if len(shape) == 2:
        place[1:-1, 1:-1] = FAR
    else:
        place[1:-1, 1:-1, 1:-1] = FAR
    return place.ravel()


@kernel(inline="always")
def _lower(heap: Ints, place: Ints, time: Floats, length: int, node: int, value: float) -> int:
    """Give ``node`` an earlier time and move it towards the root; returns the heap's length."""
    hole = place[node]
    if hole == FAR:
        hole = length
        length += 1
    time[node] = value
    while hole > 0:
        parent = (hole - 1) >> 1
        above = heap[parent]
        if time[above] <= value:
            break
        heap[hole] = above
        place[above] = hole
        hole = parent
    heap[hole] = node
    place[node] = hole
    return length


@kernel(inline="always")
def _pop(heap: Ints, place: Ints, time: Floats, length: int) -> int:
    """Remove the root; returns the heap's length."""
    place[heap[0]] = DONE
    length -= 1
    if length == 0:
        return length
    last = heap[length]
    value = time[last]
    hole = 0
    child = 1
    while child < length:
        if child + 1 < length and time[heap[child + 1]] < time[heap[child]]:
            child += 1
        below = heap[child]
        if value <= time[below]:
            break
        heap[hole] = below
        place[below] = hole
        hole = child
        child = 2 * hole + 1
    heap[hole] = last
    place[last] = hole
    return length

"""Nodes settled too soon by a given order of arrival: unsettled, and settled again through a heap.

A pass in a given order needs no heap, as long as the order is right. Where a node turns out to be earlier
than a neighbour that is settled already, every node that may depend on that neighbour is unsettled and waits
in a heap, which the pass empties as it reaches those times. So each final time comes from neighbours that are
earlier and final, as in fast marching, and no node is earlier than all of its neighbours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import kernel
from .heap import DONE, FAR, Nodes, change, take
from .updates import TIE, factored_update

# The place of a node of the source's cell, whose time is final.
SEED = -3

# Entries of ``Waiting.numbers``.
LENGTH, WAIT, UNSETTLED = 0, 1, 2


class Front(NamedTuple):
    """What ``factored_update`` takes, flat and padded; ``settled`` and ``tau`` are filled node by node."""

    strides: tuple[int, int, int]
    spacing: float
    slowness: Floats
    squares: Floats
    tau: Floats
    settled: Floats
    limit: float
    least: float


class Waiting(NamedTuple):
    """The nodes that wait to be settled out of order.

    Attributes:
        heap, keys: as in ``heap``.
        place: where a node stands in the heap, FAR for one that waits for its first settled neighbour,
            SEED for seeds, DONE for all others, whether the pass has reached them or not.
        taken: room for nodes.
        numbers: length of the heap, nodes that wait, and how often in all one was unsettled.
    """

    heap: Nodes
    keys: Floats
    place: Nodes
    taken: Nodes
    numbers: Ints


@kernel
def nothing_waiting(size: int) -> Waiting:
    """For grids of ``size`` padded nodes."""
    return Waiting(
        np.empty(size, np.int32),
        np.empty(size),
        np.full(size, DONE, np.int32),
        np.empty(size, np.int32),
        np.zeros(3, np.int64),
    )


@kernel
def wait(node: int, waiting: Waiting) -> None:
    """Let a node wait for its first settled neighbour."""
    waiting.place[node] = FAR
    waiting.numbers[WAIT] += 1


@kernel
def settle_earlier(node: int, time: float, front: Front, waiting: Waiting) -> float:
    """Settle the waiting nodes up to the time of ``node``; returns that time, which they may have changed, s.

    With a negative ``node`` and an infinite time all that wait are settled. Ends sooner once more nodes have
    been unsettled than there are.
    """
    heap, keys, place, _, numbers = waiting
    while numbers[LENGTH] > 0 and keys[0] <= time and keys[0] < math.inf and numbers[UNSETTLED] <= heap.size:
        first = heap[0]
        front.settled[first] = keys[0]
        front.tau[first] = keys[0] / math.sqrt(front.squares[first])
        numbers[LENGTH] = take(heap, keys, place, numbers[LENGTH])
        numbers[WAIT] -= 1
        correct(first, front, waiting)
        if node >= 0:
            time = _renewed(node, front)
    return time


@kernel
def correct(node: int, front: Front, waiting: Waiting) -> None:
    """Unsettle the later neighbours of ``node``, just settled, and give those that wait their new times."""
    place, taken, numbers = waiting.place, waiting.taken, waiting.numbers
    later = front.settled[node] * (1.0 + TIE)
    number = 0
    for axis in range(3):
        for neighbour in (node - front.strides[axis], node + front.strides[axis]):
            if later < front.settled[neighbour] < math.inf and place[neighbour] != SEED:
                number = _unsettle(neighbour, number, node, front, waiting)
    numbers[WAIT] += number
    numbers[UNSETTLED] += number
    for k in range(number):
        _enter(taken[k], front, waiting)
        # Their times came from this node too.
        _enter_neighbours(taken[k], front, waiting)
    _enter_neighbours(node, front, waiting)


@kernel
def _unsettle(start: int, number: int, spared: int, front: Front, waiting: Waiting) -> int:
    """Unsettle a node and all that may depend on it: those that ever later neighbours join to it.

    Adds them to ``waiting.taken``, which holds ``number`` nodes; returns the new number.
    """
    number = _take_back(start, number, front, waiting)
    done = number - 1
    while done < number:
        node = waiting.taken[done]
        done += 1
        since = front.tau[node] * (1.0 - TIE)
        for axis in range(3):
            for neighbour in (node - front.strides[axis], node + front.strides[axis]):
                if since <= front.settled[neighbour] < math.inf and neighbour != spared:
                    number = _take_back(neighbour, number, front, waiting)
    return number


@kernel
def _take_back(node: int, number: int, front: Front, waiting: Waiting) -> int:
    """Unsettle one node, unless it is a seed; its τ keeps the time that it had."""
    if waiting.place[node] == SEED:
        return number
    front.tau[node] = front.settled[node]
    front.settled[node] = math.inf
    waiting.place[node] = FAR
    waiting.taken[number] = node
    return number + 1


@kernel
def _enter_neighbours(node: int, front: Front, waiting: Waiting) -> None:
    """As ``_enter`` for the neighbours that wait."""
    for axis in range(3):
        for neighbour in (node - front.strides[axis], node + front.strides[axis]):
            if waiting.place[neighbour] > DONE:
                _enter(neighbour, front, waiting)


@kernel
def _enter(node: int, front: Front, waiting: Waiting) -> None:
    """Give a node that waits the time from its settled neighbours; infinite where they were all unsettled."""
    time = _renewed(node, front)
    if time < math.inf or waiting.place[node] != FAR:
        heap, keys, place, _, numbers = waiting
        numbers[LENGTH] = change(heap, keys, place, numbers[LENGTH], node, time)


@kernel(inline="always")
def _renewed(node: int, front: Front) -> float:
    """Travel time of a node from its settled neighbours, s."""
    return factored_update(
        node,
        front.strides,
        front.spacing,
        front.slowness,
        front.squares,
        front.tau,
        front.settled,
        front.limit,
        front.least,
    )

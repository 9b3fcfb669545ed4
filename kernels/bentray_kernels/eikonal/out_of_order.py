"""Causality repair: nodes accepted too early by a given order of arrival are recomputed through a heap.

A pass in a given order needs no heap while the order is right. Where a node gets an earlier time than an
accepted neighbour, every node that may depend on that neighbour is reset and waits in a heap, which the pass
empties as it reaches those times. So each final time is computed from earlier final times, as in fast
marching, and no node is earlier than all of its neighbours.
"""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..compilation.compiled import int64, kernel
from .heap import DONE, FAR, Nodes, pop_min, push_or_update
from .updates import TIE, Front, factored_update

# The place of nodes of the source's cell, whose times are final.
SEED = -3

# Entries of ``Waiting.numbers``.
LENGTH, WAIT, RESETS = 0, 1, 2


class Waiting(NamedTuple):
    """The nodes that wait to be accepted out of order.

    Attributes:
        heap, keys: as in ``heap``.
        place: position of a node in the heap, FAR for one that waits for its first accepted neighbour,
            SEED for seeds, DONE for all others, whether the pass has reached them or not.
        taken: scratch memory for nodes.
        numbers: length of the heap, number of waiting nodes, total number of resets.
    """

    heap: Nodes
    keys: Floats
    place: Nodes
    taken: Nodes
    numbers: Ints


@kernel
def empty_waiting(size: int) -> Waiting:
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
    """Let a node wait for its first accepted neighbour."""
    waiting.place[node] = FAR
    waiting.numbers[WAIT] += 1


@kernel
def accept_earlier(node: int, time: float, front: Front, waiting: Waiting) -> float:
    """Accept the waiting nodes up to the time of ``node``; returns that time, which they may have changed, s.

    With a negative ``node`` and an infinite time all waiting nodes are accepted. Ends early once more nodes
    have been reset than there are.
    """
    heap, keys, place, _, numbers = waiting
    while numbers[LENGTH] > 0 and keys[0] <= time and keys[0] < math.inf and numbers[RESETS] <= heap.size:
        first = int64(heap[0])
        front.settled[first] = keys[0]
        front.tau[first] = keys[0] / math.sqrt(front.squares[first])
        numbers[LENGTH] = pop_min(heap, keys, place, numbers[LENGTH])
        numbers[WAIT] -= 1
        correct(first, front, waiting)
        if node >= 0:
            time = factored_update(node, front)
    return time


@kernel
def correct(node: int, front: Front, waiting: Waiting) -> None:
    """Reset the later neighbours of ``node``, just accepted, and update the times of waiting ones."""
    place, taken, numbers = waiting.place, waiting.taken, waiting.numbers
    later = front.settled[node] * (1.0 + TIE)
    number = 0
    for axis in range(3):
        for neighbour in (node - front.strides[axis], node + front.strides[axis]):
            if later < front.settled[neighbour] < math.inf and place[neighbour] != SEED:
                number = _reset(neighbour, number, node, front, waiting)
    numbers[WAIT] += number
    numbers[RESETS] += number
    for k in range(number):
        _enter(int64(taken[k]), front, waiting)
        # Their times depend on this node too.
        _enter_neighbours(int64(taken[k]), front, waiting)
    _enter_neighbours(node, front, waiting)


@kernel
def _reset(start: int, number: int, spared: int, front: Front, waiting: Waiting) -> int:
    """Reset a node and all that may depend on it: those connected to it by chains of later neighbours.

    Adds them to ``waiting.taken``, which holds ``number`` nodes; returns the new number.
    """
    number = _reset_one(start, number, front, waiting)
    done = number - 1
    while done < number:
        node = int64(waiting.taken[done])
        done += 1
        since = front.tau[node] * (1.0 - TIE)
        for axis in range(3):
            for neighbour in (node - front.strides[axis], node + front.strides[axis]):
                if since <= front.settled[neighbour] < math.inf and neighbour != spared:
                    number = _reset_one(neighbour, number, front, waiting)
    return number


@kernel
def _reset_one(node: int, number: int, front: Front, waiting: Waiting) -> int:
    """Reset one node, unless it is a seed; its τ keeps its previous time."""
    if waiting.place[node] == SEED:
        return number
    front.tau[node] = front.settled[node]
    front.settled[node] = math.inf
    waiting.place[node] = FAR
    waiting.taken[number] = node
    return number + 1


@kernel
def _enter_neighbours(node: int, front: Front, waiting: Waiting) -> None:
    """Like ``_enter`` for the waiting neighbours."""
    for axis in range(3):
        for neighbour in (node - front.strides[axis], node + front.strides[axis]):
            if waiting.place[neighbour] > DONE:
                _enter(neighbour, front, waiting)


@kernel
def _enter(node: int, front: Front, waiting: Waiting) -> None:
    """Update the time of a waiting node from its accepted neighbours; infinite if all of them were reset."""
    time = factored_update(node, front)
    if time < math.inf or waiting.place[node] != FAR:
        heap, keys, place, _, numbers = waiting
        numbers[LENGTH] = push_or_update(heap, keys, place, numbers[LENGTH], node, time)

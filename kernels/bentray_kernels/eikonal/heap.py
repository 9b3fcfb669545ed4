"""A binary min-heap of grid nodes with back pointers, so that the time of a node in it can change.

Three arrays: ``heap`` holds nodes, ``keys`` their times, and ``place`` the position of each node in the heap,
``FAR`` for a node not yet entered, or ``DONE`` for one removed (or never to be entered). The functions take
the number of entries and return the new one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compiled import kernel

Nodes = NDArray[np.int32]

FAR = -1
DONE = -2


@kernel(inline="always")
def rise(heap: Nodes, keys: Floats, place: Nodes, hole: int, node: int, time: float) -> None:
    """Put ``node`` into a hole, moving it up past all later entries."""
    while hole > 0:
        parent = (hole - 1) >> 1
        if keys[parent] <= time:
            break
        above = heap[parent]
        heap[hole] = above
        keys[hole] = keys[parent]
        place[above] = hole
        hole = parent
    heap[hole] = node
    keys[hole] = time
    place[node] = hole


@kernel(inline="always")
def sink(heap: Nodes, keys: Floats, place: Nodes, length: int, hole: int) -> int:
    """Move a hole down to a leaf along the earlier children; returns where it ends."""
    child = 2 * hole + 2
    while child < length:
        # Arithmetic instead of a branch: the processor cannot predict which child is earlier, and wrong
        # predictions at every level double the time of the whole march.
        child -= keys[child - 1] <= keys[child]
        below = heap[child]
        heap[hole] = below
        keys[hole] = keys[child]
        place[below] = hole
        hole = child
        child = 2 * hole + 2
    if child == length:
        child -= 1
        below = heap[child]
        heap[hole] = below
        keys[hole] = keys[child]
        place[below] = hole
        hole = child
    return hole


@kernel(inline="always")
def take(heap: Nodes, keys: Floats, place: Nodes, length: int) -> int:
    """Remove the earliest entry, which the caller has read from ``heap[0]`` and ``keys[0]``."""
    place[heap[0]] = DONE
    length -= 1
    if length > 0:
        # The last entry nearly always belongs among the leaves: sink all the way, then rise a little.
        node = np.int64(heap[length])
        time = keys[length]
        rise(heap, keys, place, sink(heap, keys, place, length, 0), node, time)
    return length


@kernel(inline="always")
def change(heap: Nodes, keys: Floats, place: Nodes, length: int, node: int, time: float) -> int:
    """Enter a node, or change the time of one that is there."""
    hole = np.int64(place[node])
    if hole == FAR:
        hole = length
        length += 1
    elif time > keys[hole]:
        hole = sink(heap, keys, place, length, hole)
    rise(heap, keys, place, hole, node, time)
    return length

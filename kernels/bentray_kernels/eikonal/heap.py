"""A binary min-heap of grid nodes with back pointers, so that the time of a node in it can change.

Three arrays: ``heap`` holds nodes, ``keys`` their times, and ``place`` the position of each node in the heap,
``FAR`` for a node not yet entered, or ``DONE`` for one removed (or never to be entered). The functions take
the number of entries and return the new one.
"""

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compilation.compiled import int64, kernel

Nodes = NDArray[np.int32]

FAR = -1
DONE = -2


@kernel(inline="always")
def sift_up(heap: Nodes, keys: Floats, place: Nodes, slot: int, node: int, time: float) -> None:
    """Put ``node`` into a slot, and move it up past all later entries."""
    while slot > 0:
        parent = (slot - 1) >> 1
        if keys[parent] <= time:
            break
        above = heap[parent]
        heap[slot] = above
        keys[slot] = keys[parent]
        place[above] = slot
        slot = parent
    heap[slot] = node
    keys[slot] = time
    place[node] = slot


@kernel(inline="always")
def sift_down(heap: Nodes, keys: Floats, place: Nodes, length: int, slot: int) -> int:
    """Move an empty slot down to a leaf along the earlier children; returns where it ends."""
    child = 2 * slot + 2
    while child < length:
        # Arithmetic instead of a branch: the processor cannot predict which child is earlier, and wrong
        # predictions at every level double the time of the whole march.
        child -= keys[child - 1] <= keys[child]
        below = heap[child]
        heap[slot] = below
        keys[slot] = keys[child]
        place[below] = slot
        slot = child
        child = 2 * slot + 2
    if child == length:
        child -= 1
        below = heap[child]
        heap[slot] = below
        keys[slot] = keys[child]
        place[below] = slot
        slot = child
    return slot


@kernel(inline="always")
def pop_min(heap: Nodes, keys: Floats, place: Nodes, length: int) -> int:
    """Remove the earliest entry, which the caller has read from ``heap[0]`` and ``keys[0]``."""
    place[heap[0]] = DONE
    length -= 1
    if length > 0:
        # The last entry nearly always belongs among the leaves: sift down all the way, then up a little.
        node = int64(heap[length])
        time = keys[length]
        sift_up(heap, keys, place, sift_down(heap, keys, place, length, 0), node, time)
    return length


@kernel(inline="always")
def push_or_update(heap: Nodes, keys: Floats, place: Nodes, length: int, node: int, time: float) -> int:
    """Enter a node, or change the time of one that is there."""
    slot = int64(place[node])
    if slot == FAR:
        slot = length
        length += 1
    elif time > keys[slot]:
        slot = sift_down(heap, keys, place, length, slot)
    sift_up(heap, keys, place, slot, node, time)
    return length

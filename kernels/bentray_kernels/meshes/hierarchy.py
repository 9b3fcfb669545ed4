"""Bounding volume hierarchy of triangles, split by the surface area heuristic.

MacDonald and Booth, Heuristics for ray tracing using space subdivision (1990); in bins as Wald, On fast
construction of SAH-based bounding volume hierarchies (2007).
"""

import numpy as np
from numpy.typing import NDArray

from ..compilation.compiled import kernel

BINS = 16
# Faces of a leaf; three bits of a child's word count them.
MAX_LEAF_FACES = 4
# From this level on ranges are halved, so that the stack of a ray cannot overflow.
HALVED_FROM = 48


@kernel
def build_hierarchy(
    lows: NDArray[np.float32],
    highs: NDArray[np.float32],
    order: NDArray[np.int32],
    nodes: NDArray[np.float32],
    children: NDArray[np.int32],
) -> int:
    """Fill ``order``, ``nodes`` and ``children`` as ``Surface`` describes them.

    Args:
        lows, highs: (faces, 3) corners of each triangle's box.
        order: (faces,) 0, 1, 2 …; sorted in place.
        nodes: (at least 2·faces, 16), zero.
        children: the same memory as int32.

    Returns:
        How many nodes were filled.
    """
    faces = len(order)
    # First and last face of a range, the node that waits for it, which of its children it is, and its level.
    waiting = np.empty((faces + 2, 5), dtype=np.int64)
    middle = _split(lows, highs, order, 0, faces) if faces > MAX_LEAF_FACES else faces
    waiting[0] = (0, middle, 0, 0, 1)
    waiting[1] = (middle, faces, 0, 1, 1)
    depth, used = 2, 1
    while depth > 0:
        depth -= 1
        first, last, parent, side, level = waiting[depth]
        for axis in range(3):
            low, high = np.float32(np.inf), np.float32(-np.inf)
            for k in range(first, last):
                low = min(low, lows[order[k], axis])
                high = max(high, highs[order[k], axis])
            nodes[parent, 6 * side + axis], nodes[parent, 6 * side + 3 + axis] = low, high
        if last - first <= MAX_LEAF_FACES:
            children[parent, 12 + side] = ~(8 * first + last - first)
            continue
        middle = (first + last) // 2
        if level < HALVED_FROM:
            middle = _split(lows, highs, order, first, last)
        children[parent, 12 + side] = used
        waiting[depth] = (first, middle, used, 0, level + 1)
        waiting[depth + 1] = (middle, last, used, 1, level + 1)
        depth, used = depth + 2, used + 1
    return used


@kernel
def _split(
    lows: NDArray[np.float32], highs: NDArray[np.float32], order: NDArray[np.int32], first: int, last: int
) -> int:
    """Sort faces first … last − 1 into two parts; where the second begins."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for k in range(first, last):
        for axis in range(3):
            middle = 0.5 * (lows[order[k], axis] + highs[order[k], axis])
            low[axis], high[axis] = min(low[axis], middle), max(high[axis], middle)
    counts = np.empty(BINS, dtype=np.int64)
    boxes = np.empty((BINS, 6))
    after = np.empty(BINS)
    cheapest, best_axis, best_bin = np.inf, -1, 0
    for axis in range(3):
        if not high[axis] > low[axis]:
            continue
        scale = BINS / (high[axis] - low[axis])
        counts[:] = 0
        boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
        for k in range(first, last):
            face = order[k]
            to = _bin(lows[face, axis], highs[face, axis], low[axis], scale)
            counts[to] += 1
            for other in range(3):
                boxes[to, other] = min(boxes[to, other], lows[face, other])
                boxes[to, 3 + other] = max(boxes[to, 3 + other], highs[face, other])
        grown, count = _nothing(), 0
        for to in range(BINS - 1, 0, -1):
            grown, count = _grown(grown, boxes[to]), count + counts[to]
            after[to] = count * _half_area(grown) if count else 0.0
        grown, count = _nothing(), 0
        for to in range(BINS - 1):
            grown, count = _grown(grown, boxes[to]), count + counts[to]
            if count == 0 or count == last - first:
                continue
            cost = count * _half_area(grown) + after[to + 1]
            if cost < cheapest:
                cheapest, best_axis, best_bin = cost, axis, to
    if best_axis < 0:
        return (first + last) // 2
    scale = BINS / (high[best_axis] - low[best_axis])
    left, right = first, last - 1
    while left <= right:
        face = order[left]
        if _bin(lows[face, best_axis], highs[face, best_axis], low[best_axis], scale) <= best_bin:
            left += 1
        else:
            order[left], order[right] = order[right], face
            right -= 1
    return left


@kernel(inline="always")
def _bin(low: float, high: float, start: float, scale: float) -> int:
    return min(int((0.5 * (low + high) - start) * scale), BINS - 1)


@kernel(inline="always")
def _nothing() -> tuple[float, float, float, float, float, float]:
    return np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf


@kernel(inline="always")
def _grown(
    box: tuple[float, float, float, float, float, float], by: NDArray[np.float64]
) -> tuple[float, float, float, float, float, float]:
    return (
        min(box[0], by[0]),
        min(box[1], by[1]),
        min(box[2], by[2]),
        max(box[3], by[3]),
        max(box[4], by[4]),
        max(box[5], by[5]),
    )


@kernel(inline="always")
def _half_area(box: tuple[float, float, float, float, float, float]) -> float:
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x

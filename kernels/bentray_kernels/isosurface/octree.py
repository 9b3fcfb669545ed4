"""A min-max octree over the cells, every level a dense array of half the one below."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..compiled import kernel
from .cell_bounds import CellRanges

Ranges = NDArray[np.float32]


class Octree(NamedTuple):
    """The levels one after the other, cells first, the root last; any size, not only powers of two.

    Node (i, j, k) of a level covers the nodes 2i and 2i + 1, … of the level below, as far as there are any.

    Attributes:
        ranges: (nodes of all levels, 2) least and greatest value of the field.
        bend: (cells,) as ``CellRanges.bend``.
        levels: (levels, 4) place of a level's first node in ``ranges``, and its nodes along x, y and z.
    """

    ranges: Ranges
    bend: Ranges
    levels: Ints


def octree_of(cells: CellRanges) -> Octree:
    """The octree over bounded cells."""
    shapes = [cells.low.shape]
    while max(shapes[-1]) > 1:
        shapes.append(tuple((n + 1) // 2 for n in shapes[-1]))
    sizes = [int(np.prod(shape)) for shape in shapes]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    levels = np.array([(start, *shape) for start, shape in zip(starts[:-1], shapes, strict=True)])
    ranges = np.empty((starts[-1], 2), dtype=np.float32)
    ranges[: sizes[0], 0], ranges[: sizes[0], 1] = cells.low.ravel(), cells.high.ravel()
    for level in range(1, len(levels)):
        _gather(ranges, levels[level - 1], levels[level])
    return Octree(ranges, cells.bend.ravel(), levels)


@kernel
def _gather(ranges: Ranges, below: Ints, level: Ints) -> None:
    """The ranges of a level from those of the level below."""
    at = level[0]
    for i in range(level[1]):
        for j in range(level[2]):
            for k in range(level[3]):
                low, high = np.inf, -np.inf
                for p in range(2 * i, min(2 * i + 2, below[1])):
                    for q in range(2 * j, min(2 * j + 2, below[2])):
                        for r in range(2 * k, min(2 * k + 2, below[3])):
                            child = below[0] + (p * below[2] + q) * below[3] + r
                            low, high = min(low, ranges[child, 0]), max(high, ranges[child, 1])
                ranges[at, 0], ranges[at, 1] = low, high
                at += 1

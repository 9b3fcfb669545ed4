"""Octree over the cells: the iso-values that each node may contain, from the ranges of its cells."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from ..requests.rendering_limits import MAX_ISOS
from .cell_bounds import CellRanges

Masks = NDArray[np.uint8]


class Octree(NamedTuple):
    """The levels one after the other, cells first, the root last; any size, not only powers of two.

    Node (i, j, k) of a level covers the nodes 2i and 2i + 1, … of the level below, as far as there are any. A
    node keeps one bit an iso-value where a min-max octree keeps two numbers: rays ask nothing else, and wait
    for an eighth of the memory.

    Attributes:
        masks: (nodes of all levels,) bit m is set where iso-value m may lie in the node.
        bend: (cells,) as ``CellRanges.bend``.
        levels: (levels, 4) place of a level's first node in ``masks``, and its nodes along x, y and z.
    """

    masks: Masks
    bend: NDArray[np.float32]
    levels: Ints

    def highest_empty(self) -> int:
        """The highest level at which a ray can skip a node; 0 if there is none above the cells."""
        starts = [*self.levels[:, 0], len(self.masks)]
        levels = range(len(self.levels) - 1, 0, -1)
        return next((k for k in levels if not self.masks[starts[k] : starts[k + 1]].all()), 0)

    def occupied(self) -> Floats:
        """(2, 3) corners, nodes, of the box about all cells that may hold an iso-value; there is one."""
        shape = self.levels[0, 1:]
        held = self.masks[: shape.prod()].reshape(shape) > 0
        ends = []
        for axis in range(3):
            along = np.flatnonzero(held.any(axis=tuple({0, 1, 2} - {axis})))
            ends.append((along[0], along[-1] + 1))
        return np.array(ends, dtype=np.float64).T


def octree_of(cells: CellRanges, isos: Sequence[float]) -> Octree:
    """The octree over bounded cells.

    Args:
        cells: as ``cell_ranges`` gives them.
        isos: rising iso-values.

    Raises:
        InvalidInput: for more than 8 iso-values.
    """
    if len(isos) > MAX_ISOS:
        raise InvalidInput("iso", f"{len(isos)} values", f"at most {MAX_ISOS}")
    shapes = [cells.low.shape]
    while max(shapes[-1]) > 1:
        x, y, z = shapes[-1]
        shapes.append(((x + 1) // 2, (y + 1) // 2, (z + 1) // 2))
    sizes = [x * y * z for x, y, z in shapes]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    levels = np.array([(start, *shape) for start, shape in zip(starts[:-1], shapes, strict=True)])
    masks = np.zeros(starts[-1], dtype=np.uint8)
    for bit, iso in enumerate(isos):
        held = (cells.low <= iso) & (cells.high >= iso)
        masks[: sizes[0]] |= held.ravel().astype(np.uint8) << bit
    for level in range(1, len(levels)):
        _gather(masks, levels[level - 1], levels[level])
    return Octree(masks, cells.bend.ravel(), levels)


@kernel
def _gather(masks: Masks, below: Ints, level: Ints) -> None:
    """The masks of a level from those of the level below."""
    at = below[0]
    for i in range(below[1]):
        for j in range(below[2]):
            row = level[0] + ((i >> 1) * level[2] + (j >> 1)) * level[3]
            for k in range(below[3]):
                masks[row + (k >> 1)] |= masks[at]
                at += 1

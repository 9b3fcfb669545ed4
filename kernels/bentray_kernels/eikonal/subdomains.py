"""Fast sweeping by domain decomposition: blocks without shared memory exchange halos until convergence."""

import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..errors import InvalidInput
from .fast_sweeping import Sweeper
from .problem import Node

# The sides of a block in the order of Faces: axis, and whether its high end.
Side = tuple[int, bool]

# Position of a block among the blocks, and the nodes that it holds.
BlockIndex = tuple[int, ...]
Box = tuple[slice, ...]

# Times of a block's neighbouring nodes beyond each side, s: (low x, high x, low y, high y[, low z, high z]),
# each in the block's shape without that axis.
Faces = Sequence[Floats | None]


@dataclass(frozen=True)
class Halo:
    """Halo of a block that its neighbours receive after a sweep.

    Attributes:
        faces: the block's own outermost times on each side, s, in the order of ``Faces``.
        changed: for each side, whether its face has become earlier by more than the tolerance.
    """

    faces: tuple[Floats, ...]
    changed: tuple[bool, ...]


class Block:
    """The times of one block of a grid, swept in place from one exchange of faces to the next."""

    def __init__(
        self, slowness: Floats, spacing: float, seeds: Mapping[Node, float], times: Floats | None = None
    ) -> None:
        """Begin a solve.

        Args:
            slowness: (nx, ny[, nz]) of the block, s/m.
            spacing: node spacing, m.
            seeds: times of nodes around the source, s, by their position in the block.
            times: as ``slowness``, of the block after its last sweep, s; None: the seeds alone.
        """
        self._slowness = np.ascontiguousarray(slowness)
        self._spacing = spacing
        self._sweeper = Sweeper(slowness.shape)
        self._beyond = [_beyond(slowness.shape, side) for side in sides(slowness.ndim)]
        nodes = [np.ravel_multi_index(tuple(i + 1 for i in node), self._padded) for node in seeds]
        if times is None:
            self._sweeper.start(np.array(nodes, np.int64), np.array(list(seeds.values()), np.float64))
        else:
            self._sweeper.restart_from(times)

    @property
    def nbytes(self) -> int:
        """Memory of the arrays, bytes."""
        return self._slowness.nbytes + self._sweeper.nbytes

    @property
    def _padded(self) -> tuple[int, ...]:
        return tuple(n + 2 for n in self._slowness.shape)

    def sweep(self, faces: Faces, sent_halo: Halo | None, tolerance: float = 1e-12) -> Halo:
        """Sweep until the times have converged; to repeat it changes nothing.

        Args:
            faces: of the neighbours; None for a side where nothing has changed.
            sent_halo: the halo that the neighbours have received; None: none yet.
            tolerance: as for ``fast_sweeping``.

        Raises:
            InvalidInput: for faces of another shape.
        """
        for number, (face, (nodes, shape)) in enumerate(zip(faces, self._beyond, strict=True)):
            if face is None:
                continue
            if face.shape != shape:
                raise InvalidInput(f"faces[{number}]", f"shape {face.shape}", f"{shape}")
            finite = np.isfinite(face.ravel())
            self._sweeper.lower_times(nodes[finite], face.ravel()[finite])
        self._sweeper.sweep_until_converged(self._slowness, self._spacing, tolerance)
        own, changed = [], []
        for number, (side, (nodes, shape)) in enumerate(
            zip(sides(self._slowness.ndim), self._beyond, strict=True)
        ):
            after = self._sweeper.times_at(_inwards(nodes, self._padded, side)).reshape(shape)
            before = sent_halo.faces[number] if sent_halo else np.full(shape, math.inf)
            earlier = after < before
            drop = before[earlier] - after[earlier]
            least = tolerance * self._spacing * face_of(self._slowness, side)[earlier]
            changed.append(bool((drop > least).any()))
            own.append(after)
        return Halo(tuple(own), tuple(changed))

    def times(self) -> Floats:
        """(nx, ny[, nz]), s; infinity where no front has arrived."""
        times = np.empty(self._slowness.shape)
        self._sweeper.load(times)
        return times


def _beyond(shape: tuple[int, ...], side: Side) -> tuple[Ints, tuple[int, ...]]:
    """The nodes beyond a side: flat indices in the padded block, and their shape."""
    axis, high = side
    strides = [math.prod(n + 2 for n in shape[number + 1 :]) for number in range(len(shape))]
    along = [stride * np.arange(1, n + 1) for stride, n in zip(strides, shape, strict=True)]
    along[axis] = np.array([(shape[axis] + 1) * strides[axis] if high else 0])
    nodes: Ints = functools.reduce(np.add.outer, along)
    return nodes.ravel(), shape[:axis] + shape[axis + 1 :]


def _inwards(nodes: Ints, padded: tuple[int, ...], side: Side) -> Ints:
    """The block's own outermost nodes, next to those beyond a side."""
    axis, high = side
    stride = math.prod(padded[axis + 1 :])
    return nodes - stride if high else nodes + stride


def cut(shape: tuple[int, ...], blocks: Sequence[int]) -> dict[BlockIndex, Box]:
    """The nodes of each block, by its position among the blocks.

    Raises:
        InvalidInput: for numbers of blocks that do not fit the grid.
    """
    if len(blocks) != len(shape) or not all(1 <= b <= n for b, n in zip(blocks, shape, strict=True)):
        raise InvalidInput("blocks", tuple(blocks), f"a number from 1 along each axis, at most {shape}")
    cuts = [[n * k // b for k in range(b + 1)] for n, b in zip(shape, blocks, strict=True)]
    return {
        index: tuple(slice(c[k], c[k + 1]) for c, k in zip(cuts, index, strict=True))
        for index in itertools.product(*(range(b) for b in blocks))
    }


def sides(axes: int) -> list[Side]:
    """The sides of a block in the order of ``Faces``."""
    return [(axis, high) for axis in range(axes) for high in (False, True)]


def opposite(side: int) -> int:
    """The number of the adjacent side of the neighbouring block."""
    return side ^ 1


def face_of(block: Floats, side: Side) -> Floats:
    """The outermost nodes of a block on one side."""
    axis, high = side
    face: Floats = np.take(block, -1 if high else 0, axis)
    return face


def neighbours(index: BlockIndex, boxes: Mapping[BlockIndex, Box]) -> list[tuple[int, BlockIndex]]:
    """Numbers of the sides with a neighbouring block, and its position."""
    adjacent = []
    for side, (axis, high) in enumerate(sides(len(index))):
        beyond = (*index[:axis], index[axis] + (1 if high else -1), *index[axis + 1 :])
        if beyond in boxes:
            adjacent.append((side, beyond))
    return adjacent

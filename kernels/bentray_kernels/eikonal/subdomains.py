"""Fast sweeping by domain decomposition: blocks without shared memory exchange faces until they agree."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput
from .fast_sweeping import Sweeper

# The sides of a block in the order of Faces: axis, and whether its high end.
Side = tuple[int, bool]

# Position of a block among the blocks, and the nodes that it holds.
Place = tuple[int, ...]
Box = tuple[slice, ...]

# A block's neighbouring nodes beyond each side, s: (low x, high x, low y, high y[, low z, high z]), each in
# the block's shape without that axis; None at the boundary of the grid.
Faces = Sequence[Floats | None]


@dataclass(frozen=True)
class BlockSweep:
    """Result of ``sweep_block``.

    Attributes:
        times: (nx, ny[, nz]), s.
        faces: the block's own outermost times on each side, s, in the order of ``Faces``, for its neighbours.
        changed: for each side, whether its face has become earlier by more than the tolerance.
    """

    times: Floats
    faces: tuple[Floats, ...]
    changed: tuple[bool, ...]


def sweep_block(
    slowness: Floats, times: Floats, faces: Faces, spacing: float, tolerance: float = 1e-12
) -> BlockSweep:
    """Sweep one block until it converges, given the faces of its neighbours; pure, repeatable.

    Args:
        slowness: (nx, ny[, nz]), s/m.
        times: same shape, s; infinity where unknown. They may only be too late.
        faces: times beyond each side.
        spacing: node spacing, m.
        tolerance: as for ``fast_sweeping``.

    Raises:
        InvalidInput: for shapes that do not match.
    """
    if times.shape != slowness.shape:
        raise InvalidInput("times", f"shape {times.shape}", f"the block's shape, {slowness.shape}")
    padded = np.pad(times, 1, constant_values=math.inf)
    for number, (face, (axis, high)) in enumerate(zip(faces, sides(times.ndim), strict=True)):
        if face is None:
            continue
        expected = times.shape[:axis] + times.shape[axis + 1 :]
        if face.shape != expected:
            raise InvalidInput(f"faces[{number}]", f"shape {face.shape}", f"{expected}")
        inside: list[slice | int] = [slice(1, -1)] * times.ndim
        inside[axis] = -1 if high else 0
        padded[tuple(inside)] = face
    flat = padded.ravel()
    Sweeper(times.shape).settle(
        flat, np.ascontiguousarray(slowness), spacing, tolerance, np.flatnonzero(flat < math.inf)
    )
    new = np.ascontiguousarray(padded[(slice(1, -1),) * times.ndim])
    changed = []
    for side in sides(times.ndim):
        before, after = face_of(times, side), face_of(new, side)
        earlier = after < before
        drop = before[earlier] - after[earlier]
        changed.append(bool((drop > tolerance * spacing * face_of(slowness, side)[earlier]).any()))
    return BlockSweep(new, tuple(face_of(new, side).copy() for side in sides(times.ndim)), tuple(changed))


def cut(shape: tuple[int, ...], blocks: Sequence[int]) -> dict[Place, Box]:
    """The nodes of each block, by its position among the blocks.

    Raises:
        InvalidInput: for numbers of blocks that do not fit the grid.
    """
    if len(blocks) != len(shape) or not all(1 <= b <= n for b, n in zip(blocks, shape, strict=True)):
        raise InvalidInput("blocks", tuple(blocks), f"a number from 1 along each axis, at most {shape}")
    cuts = [[n * k // b for k in range(b + 1)] for n, b in zip(shape, blocks, strict=True)]
    return {
        place: tuple(slice(c[k], c[k + 1]) for c, k in zip(cuts, place, strict=True))
        for place in itertools.product(*(range(b) for b in blocks))
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


def neighbours(place: Place, boxes: Mapping[Place, Box]) -> list[tuple[int, Place]]:
    """Numbers of the sides with a neighbouring block, and its position."""
    adjacent = []
    for side, (axis, high) in enumerate(sides(len(place))):
        beyond = (*place[:axis], place[axis] + (1 if high else -1), *place[axis + 1 :])
        if beyond in boxes:
            adjacent.append((side, beyond))
    return adjacent

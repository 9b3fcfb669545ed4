"""Grids stored by their diagonals, so that a Gauss–Seidel sweep runs along contiguous, independent nodes.

A sweep in the order (+,+) may update all nodes of a diagonal j + k = s at once, because their neighbours lie
on s − 1 and s + 1 (Detrixhe, Gibou & Min 2013). Row ``s % rows`` holds diagonal s, column by k: neighbours
are in the same or an adjacent column of the previous and next row, and the loop is vectorised. The orders
(+,−) and (−,+) are the same in a grid with flipped j. A third axis is a stack of such planes.

Border nodes have an infinite crossing time, so that no update lowers them; slots without a node stay at −∞,
so that they never need an update.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from ..compilation.thread_team import SINGLE_THREAD, ThreadTeam

AnyFloats = NDArray[np.floating[Any]]

# Runs of updates are rounded up to a multiple of this many nodes; a multiple of the vector length.
RUN = 8

# A row holds the diagonals s and s + rows, separated by this many slots for rounded runs.
GAP = 2 * RUN

# Column of k = 1, the first of a run; the border and its border need two columns before it.
FIRST = RUN

# No column: larger than every column.
NONE = 1 << 40

# Below one changed node in this many, nodes are copied one by one.
FEW = 3

# Nodes along j and k that are copied together; the diagonals of such a tile stay in the cache.
TILE = (32, 64)


class Columns(NamedTuple):
    """A set of nodes: the lowest and the highest column of each diagonal, (planes, diagonals)."""

    low: Ints
    high: Ints

    def clear(self) -> None:
        self.low.fill(NONE)
        self.high.fill(-1)

    def any(self) -> bool:
        return bool((self.low <= self.high).any())


@dataclass(frozen=True)
class Diagonals:
    """Memory layout of a padded grid of two or three axes by diagonals.

    Attributes:
        shape: (planes, nj, nk) without the border; planes is 0 for a grid of two axes.
    """

    shape: tuple[int, int, int]

    @classmethod
    def from_shape(cls, shape: tuple[int, ...]) -> Diagonals:
        """For a grid of that shape, border not counted."""
        return cls((shape[0] if len(shape) == 3 else 0, shape[-2], shape[-1]))

    @property
    def rows(self) -> int:
        return self.shape[1] + GAP

    @property
    def width(self) -> int:
        return FIRST + RUN * math.ceil(self.shape[2] / RUN) + RUN

    @property
    def size(self) -> int:
        return self.planes * self.rows * self.width

    @property
    def planes(self) -> int:
        """Planes stored: with their border and, beyond it, one that is never a neighbour."""
        return self.shape[0] + 4 if self.shape[0] else 1

    @property
    def stored(self) -> tuple[int, int]:
        return self.rows, self.width

    def copy(
        self,
        plain: Floats,
        diagonals: Floats,
        flipped: bool,
        *,
        scale: float = 1.0,
        border: bool = True,
        back: bool = False,
        team: ThreadTeam = SINGLE_THREAD,
    ) -> None:
        """Copy a flat grid, with its border or without one, into its diagonals, times ``scale``.

        With ``back`` the diagonals are copied into the grid.
        """
        planes, nj, nk = self.shape
        rim = 2 if border else 0
        layer = (nj + rim) * (nk + rim)

        def some(first: int, end: int) -> None:
            part, shape = self._group(diagonals, first, end - rim)
            move(plain[first * layer :], part, shape, self.stored, flipped, scale, border, back)

        team.map_blocks(some, planes + rim if planes else 1, 3)

    def _group(self, diagonals: Floats, first: int, end: int) -> tuple[Floats, tuple[int, int, int]]:
        """The planes ``first`` to ``end`` as a smaller grid.

        It begins with a plane before them, where grids have one that is not copied.
        """
        planes, nj, nk = self.shape
        if not planes:
            return diagonals, self.shape
        return diagonals[first * self.rows * self.width :], (end - first, nj, nk)

    def put(self, nodes: Ints, values: Floats, into: Floats, flipped: bool = False) -> None:
        """Set the values of flat padded ``nodes``, which are numbered without the flip."""
        _exchange(nodes, values, self.shape, self.stored, into, flipped, False)

    def take(self, nodes: Ints, source: Floats, flipped: bool = False) -> Floats:
        """The values of flat padded ``nodes``, which are numbered without the flip."""
        values = np.empty(nodes.size)
        _exchange(nodes, values, self.shape, self.stored, source, flipped, True)
        return values

    def mirror(
        self, source: Floats, into: Floats, team: ThreadTeam = SINGLE_THREAD, changed: Columns | None = None
    ) -> None:
        """Copy the diagonals of a grid into those of the grid whose j is flipped.

        Args:
            source, into: diagonals.
            team: that copies.
            changed: the only nodes that differ; None: all may.
        """
        plane = self.rows * self.width

        def some(first: int, end: int) -> None:
            # Copying single nodes costs more per node than copying tiles.
            stored = slice(first + 1, end + 1) if self.shape[0] else slice(None)
            begin = stored.start or 0
            if changed is None or not _mirror_nodes(
                source[begin * plane :],
                into[begin * plane :],
                changed.low[stored],
                changed.high[stored],
                self.shape,
                self.stored,
                (end - first) * plane // FEW,
            ):
                part, shape = self._group(source, first, end - 2)
                mirror(part, self._group(into, first, end - 2)[0], shape, self.stored)

        team.map_blocks(some, self.shape[0] + 2 if self.shape[0] else 1, 3)

    def empty_ranges(self) -> Columns:
        """An empty set of nodes."""
        _, nj, nk = self.shape
        return Columns(np.full((self.planes, nj + nk + 4), NONE), np.full((self.planes, nj + nk + 4), -1))

    def include_neighbours(self, nodes: Ints, into: Columns) -> None:
        """Add the neighbours of flat padded ``nodes``."""
        _surround(nodes, self.shape, into.low, into.high)

    def mirror_mask(self, columns: Columns, into: Columns, team: ThreadTeam = SINGLE_THREAD) -> None:
        """Write these nodes, or more, in the grid whose j is flipped."""
        into.clear()

        def some(first: int, end: int) -> None:
            part = slice(first, end)
            _mirror_ranges(columns.low[part], columns.high[part], self.shape, into.low[part], into.high[part])

        team.map_blocks(some, self.planes, 1)


@kernel
def move(
    plain: AnyFloats,
    diagonals: AnyFloats,
    shape: tuple[int, int, int],
    stored: tuple[int, int],
    flipped: bool,
    scale: float | np.float32,
    border: bool,
    back: bool,
) -> None:
    """Like ``Diagonals.copy``, for numbers of any width."""
    planes, nj, nk = shape
    rows, width = stored
    step = np.uint64(width + 1)
    rim = 0 if border else 1
    # Flat distances between rows and planes of the plain grid, and where node 0 of the border would be.
    line = nk + 2 - 2 * rim
    layer = line * (nj + 2 - 2 * rim)
    origin = -rim * (line + 1 + (layer if planes else 0))
    for plane in range(rim if planes else 0, planes + 2 - rim if planes else 1):
        base = (plane + 1 if planes else 0) * rows * width
        for some in range(rim, nj + 2 - rim, TILE[0]):
            for first in range(rim, nk + 2 - rim, TILE[1]):
                for j in range(some, min(some + TILE[0], nj + 2 - rim)):
                    k = first
                    end = min(first + TILE[1], nk + 2 - rim)
                    while k < end:
                        row = ((nj + 1 - j if flipped else j) + k) % rows
                        here = np.uint64(origin + plane * layer + j * line + k)
                        there = np.uint64(base + row * width + k + FIRST - 1)
                        # One step in k is one row and one column on, until the rows begin again.
                        until = min(end - k, rows - row)
                        if back:
                            for x in range(np.uint64(until)):
                                plain[here + x] = diagonals[there + x * step]
                        else:
                            for x in range(np.uint64(until)):
                                diagonals[there + x * step] = scale * plain[here + x]
                        k += until


@kernel
def mirror(source: AnyFloats, into: AnyFloats, shape: tuple[int, int, int], stored: tuple[int, int]) -> None:
    """Like ``Diagonals.mirror``, for numbers of any width."""
    planes, nj, nk = shape
    rows, width = stored
    step = np.uint64(width + 1)
    for plane in range(planes + 2 if planes else 1):
        base = (plane + 1 if planes else 0) * rows * width
        for some in range(0, nj + 2, TILE[0]):
            for first in range(0, nk + 2, TILE[1]):
                for j in range(some, min(some + TILE[0], nj + 2)):
                    k = first
                    end = min(first + TILE[1], nk + 2)
                    while k < end:
                        old = (j + k) % rows
                        new = (nj + 1 - j + k) % rows
                        here = np.uint64(base + old * width + k + FIRST - 1)
                        there = np.uint64(base + new * width + k + FIRST - 1)
                        until = min(end - k, rows - max(old, new))
                        for x in range(np.uint64(until)):
                            into[there + x * step] = source[here + x * step]
                        k += until


@kernel
def _mirror_nodes(
    source: Floats,
    into: Floats,
    low: Ints,
    high: Ints,
    shape: tuple[int, int, int],
    stored: tuple[int, int],
    most: int,
) -> bool:
    """Copy the columns ``low`` to ``high``; returns False, having done nothing, for more than ``most``."""
    _, nj, nk = shape
    rows, width = stored
    count = 0
    for plane in range(low.shape[0]):
        for s in range(2, nj + nk + 1):
            count += max(0, high[plane, s] - low[plane, s] + 1)
    if count > most:
        return False
    for plane in range(low.shape[0]):
        base = plane * rows * width + FIRST - 1
        for s in range(2, nj + nk + 1):
            for k in range(low[plane, s], high[plane, s] + 1):
                there = base + (nj + 1 - s + 2 * k) % rows * width + k
                into[there] = source[base + s % rows * width + k]
    return True


@kernel
def _exchange(
    nodes: Ints,
    values: Floats,
    shape: tuple[int, int, int],
    stored: tuple[int, int],
    diagonals: Floats,
    flipped: bool,
    back: bool,
) -> None:
    """Like ``put`` or, with ``back``, ``take``."""
    planes, nj, nk = shape
    rows, width = stored
    for which, node in enumerate(nodes):
        k = node % (nk + 2)
        j = node // (nk + 2) % (nj + 2)
        s = (nj + 1 - j if flipped else j) + k
        plane = node // ((nk + 2) * (nj + 2)) + 1 if planes else 0
        at = plane * rows * width + s % rows * width + k + FIRST - 1
        if back:
            values[which] = diagonals[at]
        else:
            diagonals[at] = values[which]


@kernel(inline="always")
def include(
    low: Ints, high: Ints, plane: int, s: int, first: int, last: int, shape: tuple[int, int, int]
) -> None:
    """Widen the columns of a diagonal to take in ``first`` to ``last``, those of the border left out."""
    first = max(first, max(1, s - shape[1]))
    last = min(last, min(shape[2], s - 1))
    if first <= last:
        low[plane, s] = min(low[plane, s], first)
        high[plane, s] = max(high[plane, s], last)


@kernel
def _surround(nodes: Ints, shape: tuple[int, int, int], low: Ints, high: Ints) -> None:
    planes, nj, nk = shape
    for node in nodes:
        k = node % (nk + 2)
        s = node // (nk + 2) % (nj + 2) + k
        plane = node // ((nk + 2) * (nj + 2)) + 1 if planes else 0
        if not planes or 2 <= plane <= planes + 1:
            include(low, high, plane, s - 1, k - 1, k, shape)
            include(low, high, plane, s + 1, k, k + 1, shape)
        if planes and plane > 2:
            include(low, high, plane - 1, s, k, k, shape)
        if planes and plane < planes + 1:
            include(low, high, plane + 1, s, k, k, shape)


@kernel
def _mirror_ranges(low: Ints, high: Ints, shape: tuple[int, int, int], lower: Ints, higher: Ints) -> None:
    _, nj, nk = shape
    for plane in range(low.shape[0]):
        for s in range(2, nj + nk + 1):
            for k in range(low[plane, s], high[plane, s] + 1):
                t = nj + 1 - s + 2 * k
                lower[plane, t] = min(lower[plane, t], k)
                higher[plane, t] = max(higher[plane, t], k)

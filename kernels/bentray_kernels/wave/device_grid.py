"""Arrangement of padded grids on an OpenCL device: aligned rows, filled up to whole work-groups."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from .medium import Medium
from .points import REACH, Points
from .stencil import HALO

# Zeros before each row, so that rows begin on a boundary of 32 bytes. They are the halo at the end of the row
# before, too.
LEAD = 8

# Nodes along the first axis that a work-item takes: it reads 12 of them for 4 in place of 36.
ROWS = 4

# Work-items of a group along the last axis, and along the one before (in 2-D the blocks of rows).
Group = tuple[int, int]


@dataclass(frozen=True)
class DeviceGrid:
    """Place of every node of a padded image, (nx, ny[, nz]) with its margin, on the device.

    Attributes:
        shape: of the image alone.
        margin: nodes of edge and halo on every side.
        group: work-items of a group.
        filled: computed nodes along each axis, multiples of what a group computes.
    """

    shape: tuple[int, ...]
    margin: int
    group: Group
    filled: tuple[int, ...]

    @classmethod
    def from_medium(cls, medium: Medium, group: Group) -> DeviceGrid:
        """The grid of a medium."""
        shape = medium.speed.shape
        across, along = group
        multiples = (ROWS * along, across) if len(shape) == 2 else (ROWS, along, across)
        padded = medium.keep.shape
        filled = tuple(-(-(n - 2 * HALO) // m) * m for n, m in zip(padded, multiples, strict=True))
        return cls(shape, medium.margin, group, filled)

    @property
    def pitch(self) -> int:
        """From a row to the next."""
        return LEAD + self.filled[-1]

    @property
    def slab(self) -> int:
        """From a node to the next along the first axis."""
        return self.pitch * math.prod(n + 2 * HALO for n in self.filled[1:-1])

    @property
    def plane(self) -> int:
        """From the field of an emitter to that of the next."""
        return (self.filled[0] + 2 * HALO) * self.slab + LEAD

    @property
    def shift(self) -> int:
        """Place of node (0, 0[, 0]) of the padded image."""
        return LEAD - HALO

    @property
    def strides(self) -> tuple[int, ...]:
        """From a node to the next along each axis."""
        return (self.slab, 1) if len(self.shape) == 2 else (self.slab, self.pitch, 1)

    @property
    def first(self) -> int:
        """Place of the first node that is computed."""
        return HALO * sum(self.strides) + self.shift

    @property
    def blocks(self) -> int:
        """Blocks of ``ROWS`` nodes along the first axis."""
        return self.filled[0] // ROWS

    def work_items(self, emitters: int) -> tuple[int, int, int]:
        """Work-items of a time step."""
        if len(self.shape) == 2:
            return self.filled[1], self.blocks, emitters
        return self.filled[2], self.filled[1], self.blocks * emitters

    @property
    def rows(self) -> int:
        """Rows of the image."""
        return math.prod(self.shape[:-1])

    @property
    def nodes(self) -> NDArray[np.uint32]:
        """Margin; slabs, rows of a slab and nodes of a row of the image, as the program takes them."""
        middle = self.shape[1:-1] or (1,)
        return np.array((self.margin, self.shape[0], *middle, self.shape[-1]), np.uint32)

    def packed(self, factor: NDArray[Any]) -> NDArray[Any]:
        """A padded factor of the medium as (plane,); 0 in the halo and beyond the image."""
        flat = np.zeros(self.plane, factor.dtype)
        inner = factor[(slice(HALO, -HALO),) * factor.ndim]
        strides = tuple(step * factor.itemsize for step in self.strides)
        view = np.lib.stride_tricks.as_strided(flat[self.first :], inner.shape, strides)
        view[...] = inner
        return flat

    def taps(self, elements: Points) -> Ints:
        """Places of the taps of elements, (elements, 2 REACH, 2 REACH[, 2 REACH])."""
        indices: Ints = np.full((len(elements.first), *(1,) * len(self.shape)), self.shift, np.int64)
        for axis, stride in enumerate(self.strides):
            along = (elements.first[:, axis, None] + np.arange(2 * REACH)) * stride
            indices = indices + along.reshape(len(along), *_axis(axis, len(self.shape)))
        return indices


@dataclass(frozen=True)
class Gather:
    """The taps of all receivers by node, so that each node is written by one work-item.

    Attributes:
        node: (nodes,), uint32, places of nodes with a tap, ascending.
        begin: (nodes + 1,), uint32, first entry of each node.
        receiver: (entries,), uint32, ascending for each node.
        weight: (entries,), product of the weights along all axes.
    """

    node: NDArray[np.uint32]
    begin: NDArray[np.uint32]
    receiver: NDArray[np.uint32]
    weight: NDArray[Any]

    @classmethod
    def from_receivers(cls, grid: DeviceGrid, receivers: Points) -> Gather:
        """The taps of the receivers on a grid."""
        indices = grid.taps(receivers)
        dims = len(grid.shape)
        weights = np.ones((1,) * (1 + dims), receivers.weights.dtype)
        for axis in range(dims):
            weights = weights * receivers.weights[:, axis].reshape(len(indices), *_axis(axis, dims))
        owner = np.broadcast_to(np.arange(len(indices)).reshape(-1, *(1,) * dims), indices.shape).ravel()
        order = np.lexsort((owner, indices.ravel()))
        node, begin = np.unique(indices.ravel()[order], return_index=True)
        return cls(
            node.astype(np.uint32),
            np.append(begin, order.size).astype(np.uint32),
            owner[order].astype(np.uint32),
            np.ascontiguousarray(weights.ravel()[order]),
        )


def _axis(axis: int, dims: int) -> tuple[int, ...]:
    """Shape of the taps along one axis."""
    return tuple(2 * REACH if k == axis else 1 for k in range(dims))

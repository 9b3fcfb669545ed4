"""Arrangement of padded 2-D grids on an OpenCL device: aligned rows, filled up to whole work-groups."""

from __future__ import annotations

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

# Nodes along x that a work-item takes: it reads 12 rows for 4 nodes in place of 36.
ROWS = 4

# Work-items of a group along y and x.
Group = tuple[int, int]


@dataclass(frozen=True)
class DeviceGrid:
    """Place of every node of a padded image, (nx, ny) with its margin, on the device.

    Attributes:
        nodes: (margin, nx, ny), of the image alone.
        group: work-items of a group.
        width: nodes of a row that are computed, a multiple of the group's.
        height: rows that are computed, a multiple of the group's.
    """

    nodes: tuple[int, int, int]
    group: Group
    width: int
    height: int

    @classmethod
    def of(cls, medium: Medium, group: Group) -> DeviceGrid:
        """The grid of a 2-D medium."""
        nx, ny = medium.speed.shape
        inner = 2 * (medium.margin - HALO)
        across, along = group
        width = -(-(ny + inner) // across) * across
        height = -(-(nx + inner) // (along * ROWS)) * along * ROWS
        return cls((medium.margin, nx, ny), group, width, height)

    @property
    def pitch(self) -> int:
        """From a row to the next."""
        return LEAD + self.width

    @property
    def plane(self) -> int:
        """From the field of an emitter to that of the next."""
        return (self.height + 2 * HALO) * self.pitch + LEAD

    @property
    def shift(self) -> int:
        """Place of node (0, 0) of the padded image, added to ``x * pitch + y``."""
        return LEAD - HALO

    @property
    def first(self) -> int:
        """Place of the first node that is computed."""
        return HALO * self.pitch + LEAD

    @property
    def work_items(self) -> tuple[int, int]:
        """Of one emitter's time step, along y and x."""
        return self.width, self.height // ROWS

    def packed(self, factor: NDArray[Any]) -> NDArray[Any]:
        """A factor of the medium, (nx, ny) padded, as (plane,); 0 in the halo and beyond the image."""
        inner = factor[HALO:-HALO, HALO:-HALO]
        rows = np.zeros((self.height, self.pitch), factor.dtype)
        rows[: inner.shape[0], LEAD : LEAD + inner.shape[1]] = inner
        flat = np.zeros(self.plane, factor.dtype)
        flat[HALO * self.pitch : (HALO + self.height) * self.pitch] = rows.ravel()
        return flat

    def taps(self, elements: Points) -> Ints:
        """Places of the taps of elements, (elements, 2 REACH, 2 REACH)."""
        step = np.arange(2 * REACH)
        x = (elements.first[:, 0, None] + step) * self.pitch
        y = elements.first[:, 1, None] + step
        return x[:, :, None] + y[:, None, :] + self.shift


@dataclass(frozen=True)
class Gather:
    """The taps of all receivers by node, so that each node is written by one work-item.

    Attributes:
        node: (nodes,), uint32, places of nodes with a tap, ascending.
        begin: (nodes + 1,), uint32, first entry of each node.
        receiver: (entries,), uint32, ascending for each node.
        weight: (entries,), product of the weights along both axes.
    """

    node: NDArray[np.uint32]
    begin: NDArray[np.uint32]
    receiver: NDArray[np.uint32]
    weight: NDArray[Any]

    @classmethod
    def of(cls, grid: DeviceGrid, receivers: Points) -> Gather:
        """The taps of the receivers on a grid."""
        places = grid.taps(receivers)
        weights = receivers.weights[:, 0, :, None] * receivers.weights[:, 1, None, :]
        owner = np.broadcast_to(np.arange(len(places))[:, None, None], places.shape).ravel()
        order = np.lexsort((owner, places.ravel()))
        node, begin = np.unique(places.ravel()[order], return_index=True)
        return cls(
            node.astype(np.uint32),
            np.append(begin, order.size).astype(np.uint32),
            owner[order].astype(np.uint32),
            np.ascontiguousarray(weights.ravel()[order]),
        )

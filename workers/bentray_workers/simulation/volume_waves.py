"""A ring scan of the Table 7 phantom by waves in space: one ring, with what comes from above and below."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.phantoms.table7 import CHEST_M, NIPPLE_M
from bentray_kernels.phantoms.volume import PhantomSlice
from bentray_kernels.ranges import ranged
from bentray_kernels.wave.medium import EDGE_NODES
from bentray_kernels.wave.points import REACH

from .waves import FREQUENCY_HZ, WaveSimulationSettings


@dataclass(frozen=True)
class VolumeWaveSettings(WaveSimulationSettings):
    """As in a plane, but of waves in space, for which the frequency is lower unless it is given.

    The truth of the scan is the section at the ring's height; what arrives from above and below it is in the
    traces too. Beyond the chest wall the breast goes on as it is there, into the absorbing edge.
    """

    frequency_hz: float = ranged(1e5, FREQUENCY_HZ)

    dimensions: ClassVar[int] = 3
    # Each node of an edge costs far more than in a plane.
    edge_nodes: ClassVar[int] = EDGE_NODES
    phantom_side_m: ClassVar[float] = TABLE7_SIDE_M
    phantom_name: ClassVar[str] = "Table 7"

    @property
    def phantom(self) -> PhantomSlice:
        """The section in the plane of the ring."""
        return table7(self.coupling_mps).at(0.0)

    @property
    def grid(self) -> tuple[int, ...]:
        """Nodes along x, y and z."""
        below, above = self._heights
        return self.fine_nodes, self.fine_nodes, below + 1 + above

    def places_m(self) -> Floats:
        """Elements in the medium, (elements, 3), m, node 0 at 0."""
        height = self._heights[0] * self.spacing_m
        return np.column_stack((super().places_m(), np.full(self.elements, height)))

    def speed(self) -> Floats:
        """Of the object on the grid, m/s."""
        below, above = self._heights
        z = np.arange(-below, above + 1) * self._scaled_spacing
        return self.phantom.volume.speed(self.fine_nodes, TABLE7_SIDE_M, z)

    @property
    def _scaled_spacing(self) -> float:
        """Of the nodes where the phantom has its own size, m."""
        return TABLE7_SIDE_M / (self.fine_nodes - 1)

    @property
    def _heights(self) -> tuple[int, int]:
        """Nodes below the ring and above it: all of the breast, and the reach of the elements."""
        below, above = (math.ceil(abs(end) / self._scaled_spacing) + REACH for end in (CHEST_M, NIPPLE_M))
        return below, above

"""A 3-D wave simulation of a ring scan of the 3-D breast phantom (Li 2008, Table 7)."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bentray_kernels.arrays import Floats
from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.phantoms.table7 import CHEST_M, NIPPLE_M
from bentray_kernels.phantoms.volume import PhantomSlice
from bentray_kernels.requests.ranges import ranged
from bentray_kernels.wave.medium import EDGE_NODES
from bentray_kernels.wave.points import REACH

from .ranges import FREQUENCY_HZ
from .waves import WaveSimulationSettings


@dataclass(frozen=True)
class VolumeWaveSettings(WaveSimulationSettings):
    """Like ``WaveSimulationSettings`` in 3-D, with a lower default frequency.

    The truth of the scan is the section at the height of the ring; the traces also contain waves from above
    and below it. Beyond the chest wall the breast continues unchanged into the absorbing boundary.
    """

    frequency_hz: float = ranged(1e5, FREQUENCY_HZ)

    dimensions: ClassVar[int] = 3
    # Each node of the boundary costs far more than in 2-D.
    edge_nodes: ClassVar[int] = EDGE_NODES
    phantom_side_m: ClassVar[float] = TABLE7_SIDE_M
    phantom_name: ClassVar[str] = "3-D breast phantom (Li 2008, Table 7)"

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
        """Speed of sound of the object on the grid, m/s."""
        below, above = self._heights
        z = np.arange(-below, above + 1) * self._scaled_spacing
        return self.phantom.volume.speed(self.fine_nodes, TABLE7_SIDE_M, z)

    @property
    def _scaled_spacing(self) -> float:
        """Node spacing in the scale of the phantom, m."""
        return TABLE7_SIDE_M / (self.fine_nodes - 1)

    @property
    def _heights(self) -> tuple[int, int]:
        """Nodes below and above the ring: all of the breast, and the interpolation range of the elements."""
        below, above = (math.ceil(abs(end) / self._scaled_spacing) + REACH for end in (CHEST_M, NIPPLE_M))
        return below, above

"""Simulated scans of a volume by a ring at several heights: 2-D wave fronts in each plane, or 3-D."""

import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Floats
from ...errors import InvalidInput
from ...phantoms import VolumePhantom
from .fine_medium import FineMedium
from .ring_scan import Ring, TravelTimeScan, check_grid

# Nodes of the coarse grid above the highest ring and below the lowest, for rays that leave the planes.
AXIAL_MARGIN_NODES = 3


@dataclass(frozen=True)
class VolumeScan:
    """A ring moved along z, or as many rings at once (section 7.1).

    Attributes:
        phantom: sampled on the fine grid.
        ring: the elements at each height.
        z_m: heights of the ring, m, ascending.
        side_m: side of the square that holds phantom and ring, m.
        nodes: nodes along the side of the grid that a reconstruction will use.
        refinement: factor between the grids: at least 4 in 2-D, 2 in 3-D, where each doubling costs more than
            ten times the work.
        three_d: 3-D wave fronts; else the planes are independent.
    """

    phantom: VolumePhantom
    ring: Ring
    z_m: tuple[float, ...]
    side_m: float
    nodes: int = 128
    refinement: int = 4
    three_d: bool = False

    def __post_init__(self) -> None:
        heights = np.asarray(self.z_m, dtype=np.float64)
        if heights.size == 0 or not (np.isfinite(heights).all() and (np.diff(heights) > 0.0).all()):
            raise InvalidInput("z_m", self.z_m, "one or more finite heights that rise, m")
        check_grid(self.ring, self.side_m, self.refinement, 2 if self.three_d else 4)

    def slice(self, index: int) -> TravelTimeScan:
        """The independent scan of one plane."""
        return TravelTimeScan(
            self.phantom.at(self.z_m[index]), self.ring, self.side_m, self.nodes, self.refinement
        )

    def positions(self) -> Floats:
        """Elements, one height after another, (heights · elements, 3), m, origin on the axis."""
        flat = self.ring.positions()
        rings = [np.column_stack((flat, np.full(len(flat), z))) for z in self.z_m]
        return np.concatenate(rings)

    def elements(self) -> Floats:
        """``positions`` in the coordinates of ``medium``, m."""
        return np.asarray(self.positions() - (-0.5 * self.side_m, -0.5 * self.side_m, self._fine_z()[0]))

    def medium(self, *, attenuation: bool = False) -> FineMedium:
        """The phantom on the fine grid of all heights, with its attenuation or without; for ``three_d``."""
        fine = self.refinement * (self.nodes - 1) + 1
        z = self._fine_z()
        return FineMedium(
            speed=self.phantom.speed(fine, self.side_m, z),
            spacing=self.side_m / (fine - 1),
            coupling_mps=self.phantom.coupling_mps,
            attenuation=self.phantom.attenuation(fine, self.side_m, z) if attenuation else None,
            coupling_np_m=self.phantom.coupling_np_m,
        )

    def _fine_z(self) -> Floats:
        coarse = self.side_m / (self.nodes - 1)
        first = self.z_m[0] - AXIAL_MARGIN_NODES * coarse
        height = self.z_m[-1] - self.z_m[0] + 2 * AXIAL_MARGIN_NODES * coarse
        # A height that is a multiple of the spacing within rounding needs no additional plane.
        steps = math.ceil(height * self.refinement / coarse - 1e-6)
        return np.asarray(first + np.arange(steps + 1) * (coarse / self.refinement))

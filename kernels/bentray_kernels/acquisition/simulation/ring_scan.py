"""Simulated ring scans of a phantom, on a finer grid and with another scheme than the inversions."""

from dataclasses import dataclass

import numpy as np

from ...arrays import Floats, Ints
from ...errors import InvalidInput
from ...phantoms import DetailedBreast, EllipsePhantom, PhantomSlice
from .fine_medium import FineMedium


@dataclass(frozen=True)
class Ring:
    """Equally spaced elements on a circle, each emitter and receiver.

    Attributes:
        elements: their number.
        radius_m: of the circle, m.
    """

    elements: int
    radius_m: float

    def __post_init__(self) -> None:
        if self.elements < 3:
            raise InvalidInput("elements", self.elements, "at least 3")
        if not 0.0 < self.radius_m < np.inf:
            raise InvalidInput("radius_m", self.radius_m, "a finite radius > 0 m")

    def positions(self) -> Floats:
        """(elements, 2), m, centred on 0; element 0 on the x axis, then anticlockwise."""
        angle = 2.0 * np.pi * np.arange(self.elements) / self.elements
        return self.radius_m * np.column_stack((np.cos(angle), np.sin(angle)))


def check_grid(ring: Ring, side_m: float, refinement: int, least: int) -> None:
    """Check that a simulation is finer than inversions of its data, and that its grid holds the ring.

    Raises:
        InvalidInput: naming ``refinement``, if it is below ``least``, or ``radius_m``.
    """
    if refinement < least:
        accepted = f"at least {least}: a coarser grid would be an inverse crime"
        raise InvalidInput("refinement", refinement, accepted)
    if ring.radius_m > 0.5 * side_m:
        raise InvalidInput("radius_m", ring.radius_m, f"at most half the side, {0.5 * side_m:g} m")


@dataclass(frozen=True)
class TravelTimeScan:
    """A scan to simulate: phantom, ring and grid.

    Attributes:
        phantom: sampled on the fine grid, not interpolated from a coarse one.
        ring: the elements.
        side_m: side of the square that holds both, m.
        nodes: nodes along the side of the grid that a reconstruction will use.
        refinement: factor between the grids; at least 4, so that the data do not contain the discretisation
            error of the inversion.
    """

    phantom: EllipsePhantom | PhantomSlice | DetailedBreast
    ring: Ring
    side_m: float
    nodes: int = 128
    refinement: int = 4

    def __post_init__(self) -> None:
        check_grid(self.ring, self.side_m, self.refinement, 4)

    @property
    def fine_nodes(self) -> int:
        """Nodes along the side of the fine grid."""
        return self.refinement * (self.nodes - 1) + 1

    def elements(self) -> Floats:
        """Elements in the fine grid's coordinates, (elements, 2), m."""
        return self.ring.positions() + 0.5 * self.side_m

    def medium(self, *, attenuation: bool = False) -> FineMedium:
        """The phantom on the fine grid, with its attenuation or without."""
        return FineMedium(
            speed=self.phantom.speed(self.fine_nodes, self.side_m),
            spacing=self.side_m / (self.fine_nodes - 1),
            coupling_mps=self.phantom.coupling_mps,
            attenuation=self.phantom.attenuation(self.fine_nodes, self.side_m) if attenuation else None,
            coupling_np_m=self.phantom.coupling_np_m,
        )

    def delta_tof(self, emitters: Ints) -> Floats:
        """Object minus water travel time from some emitters to every element, (k, elements), s.

        Several calls cost less through ``medium().arrivals``, which samples the phantom once.
        """
        return self.medium().arrivals(self.elements(), emitters)[0]

"""Travel times of a phantom scan, made on a finer grid with another scheme than any inversion here uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..eikonal import solve
from ..errors import InvalidInput
from ..phantoms.ellipses import EllipsePhantom


@dataclass(frozen=True)
class Ring:
    """Equally spaced elements on a circle, each emitter and receiver.

    Attributes:
        elements: how many.
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


@dataclass(frozen=True)
class TravelTimeScan:
    """A scan to simulate: what, by which ring, how finely.

    Attributes:
        phantom: sampled afresh on the fine grid, never interpolated from a coarse one.
        ring: the elements.
        side_m: side of the square that holds both, m.
        nodes: nodes along the side of the grid that a reconstruction will use.
        refinement: how many times finer the simulation is; at least 4, so that the inversion's own
            discretisation cannot hide in the data.
    """

    phantom: EllipsePhantom
    ring: Ring
    side_m: float
    nodes: int = 128
    refinement: int = 4

    def __post_init__(self) -> None:
        if self.refinement < 4:
            raise InvalidInput(
                "refinement", self.refinement, "at least 4: a coarser grid would be an inverse crime"
            )
        if self.ring.radius_m > 0.5 * self.side_m:
            raise InvalidInput(
                "radius_m", self.ring.radius_m, f"at most half the side, {0.5 * self.side_m:g} m"
            )

    def fine_speed(self) -> Floats:
        """Speed on the fine grid, (fine nodes, fine nodes), m/s."""
        return self.phantom.speed(self.fine_nodes, self.side_m)

    @property
    def fine_nodes(self) -> int:
        return self.refinement * (self.nodes - 1) + 1

    def delta_tof(self, emitters: Ints, fine_speed: Floats | None = None) -> Floats:
        """Object minus water travel time from some emitters to every element.

        The wave front marches by the heap (``hafmm``) and is read off the grid itself; inversions
        here sweep and integrate along rays.

        Args:
            emitters: (k,) element numbers.
            fine_speed: ``fine_speed()``, for callers that keep it between calls.

        Returns:
            (k, elements), s; 0 from an element to itself.
        """
        speed = self.fine_speed() if fine_speed is None else fine_speed
        spacing = self.side_m / (self.fine_nodes - 1)
        positions = self.ring.positions() + 0.5 * self.side_m
        delta = np.empty((len(emitters), self.ring.elements))
        for row, emitter in enumerate(emitters):
            source = positions[emitter]
            tof = solve(speed, spacing, source, "hafmm")
            distance = np.linalg.norm(positions - source, axis=1)
            delta[row] = _read(tof, spacing, source, positions) - distance / self.phantom.coupling_mps
            delta[row, emitter] = 0.0
        return delta


def _read(tof: Floats, spacing: float, source: Floats, points: Floats) -> Floats:
    """Travel time between the nodes: T divided by the distance is smooth, so that is what is interpolated."""
    low = np.clip((points / spacing).astype(np.int64), 0, np.array(tof.shape) - 2)
    part = points / spacing - low
    mean_slowness = np.zeros(len(points))
    weight_sum = np.zeros(len(points))
    for dx in (0, 1):
        for dy in (0, 1):
            node = low + np.array((dx, dy))
            distance = np.linalg.norm(node * spacing - source, axis=1)
            weight = np.where(dx, part[:, 0], 1.0 - part[:, 0]) * np.where(dy, part[:, 1], 1.0 - part[:, 1])
            weight = np.where(distance > 0.0, weight, 0.0)
            mean_slowness += weight * tof[node[:, 0], node[:, 1]] / np.where(distance > 0.0, distance, 1.0)
            weight_sum += weight
    away = np.linalg.norm(points - source, axis=1)
    return np.asarray(away * mean_slowness / np.where(weight_sum > 0.0, weight_sum, 1.0))

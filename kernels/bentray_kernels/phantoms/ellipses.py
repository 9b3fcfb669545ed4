"""Phantoms of nested ellipses, sampled with area averaging."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Flags, Floats
from ..errors import InvalidInput

# Points a side that a node's cell is averaged over.
SUBSAMPLES = 8


@dataclass(frozen=True)
class Ellipse:
    """A filled ellipse.

    Attributes:
        centre_m: (x, y), m.
        semi_axes_m: half lengths along its own axes, m.
        angle_rad: turn of the first axis from x towards y.
        speed_mps: sound speed inside, m/s.
        attenuation_np_m: attenuation inside, Np/m.
        name: of the tissue.
    """

    centre_m: tuple[float, float]
    semi_axes_m: tuple[float, float]
    speed_mps: float
    attenuation_np_m: float
    name: str
    angle_rad: float = 0.0

    def contains(self, x: Floats, y: Floats) -> Flags:
        """Whether points (x, y), m, lie inside; any shapes that broadcast."""
        dx, dy = x - self.centre_m[0], y - self.centre_m[1]
        c, s = math.cos(self.angle_rad), math.sin(self.angle_rad)
        along = (c * dx + s * dy) / self.semi_axes_m[0]
        across = (c * dy - s * dx) / self.semi_axes_m[1]
        return np.asarray(along * along + across * across <= 1.0)


@dataclass(frozen=True)
class HalfEllipse(Ellipse):
    """The half of an ellipse before its own second axis, where that coordinate is at most 0."""

    def contains(self, x: Floats, y: Floats) -> Flags:
        """See ``Ellipse``."""
        c, s = math.cos(self.angle_rad), math.sin(self.angle_rad)
        across = c * (y - self.centre_m[1]) - s * (x - self.centre_m[0])
        return super().contains(x, y) & (across <= 0.0)


@dataclass(frozen=True)
class EllipsePhantom:
    """Ellipses painted in order over the coupling medium; the first is the outline of the object.

    Attributes:
        coupling_mps: speed outside, m/s.
        coupling_np_m: attenuation outside, Np/m.
        ellipses: the outline first, then what lies in it, later ones on top.
    """

    coupling_mps: float
    ellipses: tuple[Ellipse, ...]
    coupling_np_m: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.coupling_mps) and self.coupling_mps > 0.0):
            raise InvalidInput("coupling_mps", self.coupling_mps, "a finite speed > 0 m/s")

    def speed_at(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Exact speed at points, m; shapes as they broadcast, m/s."""
        return self._paint(x, y, self.coupling_mps, [e.speed_mps for e in self.ellipses])

    def speed(self, nodes: int, side_m: float) -> Floats:
        """Speed on a square grid centred on 0, each node the mean over its own cell.

        Args:
            nodes: nodes along each side.
            side_m: distance of the first from the last node, m.

        Returns:
            (nodes, nodes), x first, m/s.
        """
        return self._average(nodes, side_m, self.coupling_mps, [e.speed_mps for e in self.ellipses])

    def attenuation(self, nodes: int, side_m: float) -> Floats:
        """Like ``speed``, Np/m."""
        return self._average(nodes, side_m, self.coupling_np_m, [e.attenuation_np_m for e in self.ellipses])

    def inside(self, nodes: int, side_m: float) -> Flags:
        """Nodes inside the outline, (nodes, nodes)."""
        axis = node_positions(nodes, side_m)
        return self.ellipses[0].contains(axis[:, None], axis[None, :])

    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the object, m/s, the coupling left out."""
        speeds = [e.speed_mps for e in self.ellipses]
        return min(speeds), max(speeds)

    def _paint(self, x: ArrayLike, y: ArrayLike, outside: float, values: list[float]) -> Floats:
        xs, ys = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64))
        painted = np.full(xs.shape, outside)
        for ellipse, value in zip(self.ellipses, values, strict=True):
            painted[ellipse.contains(xs, ys)] = value
        return painted

    def _average(self, nodes: int, side_m: float, outside: float, values: list[float]) -> Floats:
        axis = node_positions(nodes, side_m)
        spacing = axis[1] - axis[0]
        fine = ((np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5) * spacing
        total = np.zeros((nodes, nodes))
        for dx in fine:
            for dy in fine:
                total += self._paint(axis[:, None] + dx, axis[None, :] + dy, outside, values)
        return total / SUBSAMPLES**2


def node_positions(nodes: int, side_m: float) -> Floats:
    """Coordinates of the nodes along one side of a square centred on 0, m.

    Raises:
        InvalidInput: for fewer than two nodes or a side that is not positive.
    """
    if nodes < 2:
        raise InvalidInput("nodes", nodes, "at least 2")
    if not (math.isfinite(side_m) and side_m > 0.0):
        raise InvalidInput("side_m", side_m, "a finite length > 0 m")
    return (np.arange(nodes) / (nodes - 1) - 0.5) * side_m

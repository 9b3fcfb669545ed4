"""Solids of 3-D phantoms: ellipsoids, and bodies whose outline varies along z."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Floats


class Solid(Protocol):
    """A body that can say where it is."""

    def level(self, x: Floats, y: Floats, z: Floats) -> Floats:
        """At most 1 inside and above 1 outside; at points, m, of shapes that broadcast."""
        ...


@dataclass(frozen=True)
class Ellipsoid:
    """A filled ellipsoid with one axis along z.

    Attributes:
        centre_m: (x, y, z), m.
        semi_axes_m: half lengths along its own axes, m.
        angle_rad: turn of the first axis from x towards y.
    """

    centre_m: tuple[float, float, float]
    semi_axes_m: tuple[float, float, float]
    angle_rad: float = 0.0

    def level(self, x: Floats, y: Floats, z: Floats) -> Floats:
        """See ``Solid.level``."""
        dx, dy, dz = x - self.centre_m[0], y - self.centre_m[1], z - self.centre_m[2]
        c, s = math.cos(self.angle_rad), math.sin(self.angle_rad)
        a, b, h = self.semi_axes_m
        across = ((c * dx + s * dy) / a) ** 2 + ((c * dy - s * dx) / b) ** 2
        return np.asarray(np.sqrt(across + (dz / h) ** 2))


@dataclass(frozen=True)
class Dome:
    """A body round the z axis that narrows to a tip, its outline an ellipse with waves in it.

    With t = (z − base) / (tip − base) the semi-axes shrink as (1 − t^p)^(1/p), p the bluntness; below the
    base they stay as they are. The centre drifts by ``drift_m`` · t² from its place at the base. The
    radius in direction θ is multiplied by 1 + Σ wave · cos(n·(θ − twist·t)).

    Attributes:
        base_m, tip_m: z of the widest section and of the tip, m; base < tip.
        centre_m: (x, y) of the widest section, m.
        semi_axes_m: along x and y, of the widest section, m.
        bluntness: p; 2 is half an ellipsoid, more is blunter.
        drift_m: (x, y) of the tip less that of the widest section, m.
        waves: (n, wave) pairs, the waves together below 1; none is a plain ellipse.
        twist_rad: how far the waves turn from base to tip.
    """

    base_m: float
    tip_m: float
    centre_m: tuple[float, float]
    semi_axes_m: tuple[float, float]
    bluntness: float = 2.0
    drift_m: tuple[float, float] = (0.0, 0.0)
    waves: tuple[tuple[int, float], ...] = ()
    twist_rad: float = 0.0

    def level(self, x: Floats, y: Floats, z: Floats) -> Floats:
        """Like ``Solid.level``; infinite from the tip on."""
        t = np.maximum((z - self.base_m) / (self.tip_m - self.base_m), 0.0)
        scale = np.maximum(1.0 - t**self.bluntness, 0.0) ** (1.0 / self.bluntness)
        u = (x - self.centre_m[0] - self.drift_m[0] * t * t) / self.semi_axes_m[0]
        v = (y - self.centre_m[1] - self.drift_m[1] * t * t) / self.semi_axes_m[1]
        ratio: Floats = np.sqrt(u * u + v * v)
        if self.waves:
            angle = np.arctan2(v, u) - self.twist_rad * t
            ratio = ratio / (1.0 + sum(wave * np.cos(n * angle) for n, wave in self.waves))
        beyond = np.broadcast_to(scale == 0.0, ratio.shape)
        return np.where(beyond, np.inf, ratio / np.where(scale == 0.0, 1.0, scale))

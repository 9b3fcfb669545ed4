"""Phantoms of overlapping solids, sampled as volumes or slices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Flags, Floats
from ..errors import InvalidInput
from .averaging import plane_means
from .ellipses import node_positions
from .solids import Solid


@dataclass(frozen=True)
class Part:
    """A solid and what it is made of.

    Attributes:
        solid: where it is.
        speed_mps: sound speed inside, m/s.
        attenuation_np_m: attenuation inside, Np/m.
        name: of the tissue.
    """

    solid: Solid
    speed_mps: float
    attenuation_np_m: float
    name: str


@dataclass(frozen=True)
class VolumePhantom:
    """Solids painted in order over the coupling medium; the first is the outline of the object.

    Attributes:
        coupling_mps: speed outside, m/s.
        parts: the outline first, then what lies in it, later ones on top.
        coupling_np_m: attenuation outside, Np/m.
    """

    coupling_mps: float
    parts: tuple[Part, ...]
    coupling_np_m: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.coupling_mps) and self.coupling_mps > 0.0):
            raise InvalidInput("coupling_mps", self.coupling_mps, "a finite speed > 0 m/s")
        if not 0.0 <= self.coupling_np_m < math.inf:
            raise InvalidInput("coupling_np_m", self.coupling_np_m, "a finite attenuation >= 0 Np/m")

    def speed_at(self, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Floats:
        """Exact speed at points, m; shapes as they broadcast, m/s."""
        return self._paint(x, y, z, self.speeds_mps)

    def speed(self, nodes: int, side_m: float, z_m: ArrayLike) -> Floats:
        """Speed in a box centred on the z axis, each node the mean over its own cell.

        Args:
            nodes: nodes along x and along y.
            side_m: distance of the first from the last node along x and y, m.
            z_m: (nz,), evenly spaced positions along z, m; a cell is as high as they are apart.

        Returns:
            (nodes, nodes, nz), m/s.

        Raises:
            InvalidInput: for a grid that is not one.
        """
        return self._average(nodes, side_m, z_m, self.speeds_mps)

    def attenuation(self, nodes: int, side_m: float, z_m: ArrayLike) -> Floats:
        """Like ``speed``, Np/m."""
        return self._average(nodes, side_m, z_m, self.attenuations_np_m)

    def inside(self, nodes: int, side_m: float, z_m: ArrayLike) -> Flags:
        """Nodes inside the outline, (nodes, nodes, nz)."""
        axis, z = node_positions(nodes, side_m), np.asarray(z_m, dtype=np.float64)
        return self.parts[0].solid.level(axis[:, None, None], axis[None, :, None], z) <= 1.0

    def at(self, z_m: float) -> PhantomSlice:
        """The section at z, m, as a phantom of two dimensions."""
        return PhantomSlice(self, z_m)

    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the object, m/s, the coupling left out."""
        return min(self.speeds_mps[1:]), max(self.speeds_mps[1:])

    @property
    def speeds_mps(self) -> tuple[float, ...]:
        """Speeds of the coupling, then of each part, m/s."""
        return (self.coupling_mps, *(part.speed_mps for part in self.parts))

    @property
    def attenuations_np_m(self) -> tuple[float, ...]:
        """See ``speeds_mps``."""
        return (self.coupling_np_m, *(part.attenuation_np_m for part in self.parts))

    def _paint(self, x: ArrayLike, y: ArrayLike, z: ArrayLike, values: Sequence[float]) -> Floats:
        points = np.broadcast_arrays(*(np.asarray(p, dtype=np.float64) for p in (x, y, z)))
        painted = np.full(points[0].shape, values[0])
        for part, value in zip(self.parts, values[1:], strict=True):
            painted[part.solid.level(*points) <= 1.0] = value
        return painted

    def _average(self, nodes: int, side_m: float, z_m: ArrayLike, values: Sequence[float]) -> Floats:
        z = np.asarray(z_m, dtype=np.float64)
        height = float(z[1] - z[0]) if z.ndim == 1 and z.size > 1 else math.nan
        if not (height > 0.0 and np.allclose(np.diff(z), height, rtol=1e-6, atol=0.0)):
            raise InvalidInput("z_m", z.tolist(), "two or more evenly rising positions in m")
        solids = [part.solid for part in self.parts]
        planes = [plane_means(solids, nodes, side_m, z_m, height, values) for z_m in z]
        return np.ascontiguousarray(np.stack(planes, axis=-1))


@dataclass(frozen=True)
class PhantomSlice:
    """The section of a volume at one z: it offers what ``EllipsePhantom`` offers.

    Attributes:
        volume: what is cut.
        z_m: where, m.
    """

    volume: VolumePhantom
    z_m: float

    @property
    def coupling_mps(self) -> float:
        """Speed outside, m/s."""
        return self.volume.coupling_mps

    @property
    def coupling_np_m(self) -> float:
        """Attenuation outside, Np/m."""
        return self.volume.coupling_np_m

    def speed_at(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Exact speed at points, m; shapes as they broadcast, m/s."""
        return self.volume.speed_at(x, y, self.z_m)

    def speed(self, nodes: int, side_m: float) -> Floats:
        """Like ``EllipsePhantom.speed``: means over squares in the plane, (nodes, nodes), m/s."""
        return self._average(nodes, side_m, self.volume.speeds_mps)

    def attenuation(self, nodes: int, side_m: float) -> Floats:
        """Like ``speed``, Np/m."""
        return self._average(nodes, side_m, self.volume.attenuations_np_m)

    def inside(self, nodes: int, side_m: float) -> Flags:
        """Nodes inside the outline, (nodes, nodes)."""
        return np.asarray(self.volume.inside(nodes, side_m, [self.z_m])[..., 0])

    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the whole object, m/s, the coupling left out."""
        return self.volume.speed_range()

    def _average(self, nodes: int, side_m: float, values: Sequence[float]) -> Floats:
        solids = [part.solid for part in self.volume.parts]
        return plane_means(solids, nodes, side_m, self.z_m, 0.0, values)

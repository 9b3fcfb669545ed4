"""2-D breast phantoms with detail: skin, fat with ligaments, glandular texture of 1 to 5 mm, lesions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ..arrays import Flags, Floats
from ..errors import InvalidInput
from .ellipses import Ellipse, node_positions

# Side of the square that the phantom is made for, m.
DETAILED_SIDE_M = 0.23

# Waviness of the outline and of that of the gland; part of the radius that is skin.
WAVINESS, GLAND_WAVINESS, SKIN_PART = 0.03, 0.18, 0.025

# Points along each side of a node's cell, and rows of nodes that are averaged at a time.
SUBSAMPLES, ROWS = 4, 32


class Tissue(NamedTuple):
    """Sound speed, m/s, its standard deviation within the tissue, m/s, and attenuation, Np/m."""

    speed_mps: float
    variation_mps: float
    attenuation_np_m: float


SKIN = Tissue(1560.0, 0.0, 20.0)
FAT = Tissue(1448.0, 5.0, 5.0)
GLAND = Tissue(1520.0, 4.0, 10.0)
# Fat lobules between the lobes of the gland, and ligaments in the fat.
LOBULE = Tissue(1462.0, 0.0, 5.0)
LIGAMENT = Tissue(1510.0, 0.0, 10.0)
LESIONS = (
    Ellipse((-0.020, 0.012), (0.006, 0.006), 1575.0, 25.0, "tumour"),
    Ellipse((0.028, -0.016), (0.004, 0.004), 1570.0, 25.0, "tumour"),
    Ellipse((0.005, 0.030), (0.0025, 0.0025), 1575.0, 25.0, "small tumour"),
    Ellipse((-0.015, -0.025), (0.005, 0.005), 1480.0, 0.0, "cyst"),
    Ellipse((0.040, 0.010), (0.0015, 0.0015), 1575.0, 25.0, "smallest tumour"),
)


class Anatomy(NamedTuple):
    """Parameters that distinguish one breast from another.

    Attributes:
        seed: of outline and texture.
        semi_axes_m: of the outline, m.
        gland_part: part of the radius within which there is glandular tissue.
        lobule_level: of the texture, in standard deviations; below it there is fat between the lobes.
        lesions: with their speeds and attenuations.
    """

    seed: int = 0
    semi_axes_m: tuple[float, float] = (0.075, 0.070)
    gland_part: float = 0.72
    lobule_level: float = -0.1
    lesions: tuple[Ellipse, ...] = LESIONS


# The breast of the benchmarks.
DETAILED = Anatomy()

# A breast with mostly glandular tissue, and lesions large enough that images by rays show them, too.
LARGE_LESIONS = Anatomy(
    71,
    (0.080, 0.074),
    0.80,
    -1.5,
    (
        Ellipse((-0.030, 0.016), (0.013, 0.010), 1580.0, 25.0, "tumour", 0.5),
        Ellipse((0.032, -0.018), (0.010, 0.010), 1575.0, 25.0, "small tumour"),
        Ellipse((0.014, 0.024), (0.014, 0.011), 1430.0, 5.0, "fat lobule", -0.4),
        Ellipse((-0.012, -0.026), (0.011, 0.011), 1460.0, 0.0, "cyst"),
    ),
)


def _tumour_and_cyst(
    tumour: tuple[float, float], small: tuple[float, float], cyst: tuple[float, float]
) -> tuple[Ellipse, ...]:
    return (
        Ellipse(tumour, (0.006, 0.005), 1575.0, 25.0, "tumour", 0.4),
        Ellipse(small, (0.003, 0.003), 1570.0, 25.0, "small tumour"),
        Ellipse(cyst, (0.005, 0.005), 1480.0, 0.0, "cyst"),
    )


# One breast of each of the four classes of density of ACR BI-RADS, a to d.
DENSITIES: Mapping[str, Anatomy] = MappingProxyType(
    {
        "fatty": Anatomy(
            11,
            (0.074, 0.071),
            0.50,
            0.55,
            _tumour_and_cyst((-0.018, 0.010), (0.022, -0.014), (0.004, -0.030)),
        ),
        "scattered": Anatomy(
            12,
            (0.076, 0.068),
            0.78,
            0.1,
            _tumour_and_cyst((0.024, 0.012), (-0.010, 0.030), (-0.022, -0.018)),
        ),
        "heterogeneous": Anatomy(
            13,
            (0.070, 0.073),
            0.88,
            -0.5,
            _tumour_and_cyst((-0.026, -0.010), (0.012, 0.034), (0.024, -0.020)),
        ),
        "dense": Anatomy(
            14, (0.071, 0.068), 0.95, -1.3, _tumour_and_cyst((0.012, -0.026), (-0.030, 0.006), (0.016, 0.028))
        ),
    }
)


class Waves(NamedTuple):
    """A random field of mean 0 and variance 1: a sum of plane waves, each array of their number."""

    x: Floats
    y: Floats
    phase: Floats

    @classmethod
    def drawn(cls, random: np.random.Generator, count: int, shortest_m: float, longest_m: float) -> Waves:
        """Waves of random directions with lengths between two."""
        length = np.exp(random.uniform(math.log(shortest_m), math.log(longest_m), count))
        direction = random.uniform(0.0, np.pi, count)
        number = 2.0 * np.pi / length
        return cls(
            number * np.cos(direction), number * np.sin(direction), random.uniform(0.0, 2.0 * np.pi, count)
        )

    def at(self, x: Floats, y: Floats) -> Floats:
        """(len(x), len(y)): the field at all pairs of coordinates, m."""
        along, across = np.outer(x, self.x), np.outer(y, self.y) + self.phase
        waves = np.cos(along) @ np.cos(across).T - np.sin(along) @ np.sin(across).T
        return np.asarray(math.sqrt(2.0 / len(self.x)) * waves)


@dataclass(frozen=True)
class DetailedBreast:
    """The phantom, centred on 0; a continuous function of the place, so any grid samples the same object.

    Attributes:
        coupling_mps: speed of the water, m/s.
        coupling_np_m: attenuation of the water, Np/m.
        anatomy: of the breast, such as one of ``DENSITIES``.
    """

    coupling_mps: float
    coupling_np_m: float = 0.0
    anatomy: Anatomy = DETAILED

    def __post_init__(self) -> None:
        if not (math.isfinite(self.coupling_mps) and self.coupling_mps > 0.0):
            raise InvalidInput("coupling_mps", self.coupling_mps, "a finite speed > 0 m/s")

    def speed(self, nodes: int, side_m: float) -> Floats:
        """Speed on a square grid centred on 0, each node the mean over its own cell.

        Args:
            nodes: nodes along each side.
            side_m: distance of the first from the last node, m.

        Returns:
            (nodes, nodes), x first, m/s.
        """
        return self._means(nodes, side_m, 0)

    def attenuation(self, nodes: int, side_m: float) -> Floats:
        """Like ``speed``, Np/m."""
        return self._means(nodes, side_m, 1)

    def inside(self, nodes: int, side_m: float) -> Flags:
        """Nodes inside the skin's outer surface, (nodes, nodes)."""
        axis = node_positions(nodes, side_m)
        return np.asarray(_depth(_fields(self.anatomy)[0], self.anatomy, axis, axis) < 1.0)

    def glandular(self, nodes: int, side_m: float) -> float:
        """Part of the area inside the skin that glandular tissue fills."""
        axis = node_positions(nodes, side_m)
        inner, gland, grain, _ = _tissues(_fields(self.anatomy), self.anatomy, axis, axis)
        return float((gland & (grain > self.anatomy.lobule_level)).sum() / inner.sum())

    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the object, m/s, the coupling left out; of fat three deviations."""
        lesions = [lesion.speed_mps for lesion in self.anatomy.lesions]
        return min(FAT.speed_mps - 3.0 * FAT.variation_mps, *lesions), max(lesions)

    def _means(self, nodes: int, side_m: float, quantity: int) -> Floats:
        axis = node_positions(nodes, side_m)
        offsets = ((np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5) * (axis[1] - axis[0])
        fine = (axis[:, None] + offsets).ravel()
        fields, outside = _fields(self.anatomy), (self.coupling_mps, self.coupling_np_m)[quantity]
        means = np.empty((nodes, nodes))
        for row in range(0, nodes, ROWS):
            rows = fine[row * SUBSAMPLES : (row + ROWS) * SUBSAMPLES]
            painted = _painted(fields, self.anatomy, rows, fine, quantity, outside)
            means[row : row + ROWS] = painted.reshape(-1, SUBSAMPLES, nodes, SUBSAMPLES).mean(axis=(1, 3))
        return means


def _fields(anatomy: Anatomy) -> tuple[Waves, Waves, Waves, Waves]:
    """Outline, outline of the gland, texture of the gland, variation within the tissues."""
    random = np.random.default_rng(anatomy.seed)
    texture = Waves.drawn(random, 96, 0.004, 0.016)
    lobes = Waves.drawn(random, 24, 0.02, 0.06)
    outline = Waves.drawn(random, 16, 0.03, 0.12)
    return outline, lobes, texture, Waves.drawn(random, 48, 0.003, 0.01)


def _depth(outline: Waves, anatomy: Anatomy, x: Floats, y: Floats) -> Floats:
    """0 in the middle, 1 at the outer surface of the skin."""
    radius = np.hypot(x[:, None] / anatomy.semi_axes_m[0], y[None, :] / anatomy.semi_axes_m[1])
    return np.asarray(radius + WAVINESS * outline.at(x, y))


def _tissues(
    fields: tuple[Waves, Waves, Waves, Waves], anatomy: Anatomy, x: Floats, y: Floats
) -> tuple[Flags, Flags, Floats, Floats]:
    """Inside the skin, within the outline of the gland, texture, and depth, each (len(x), len(y))."""
    outline, lobes, texture, _ = fields
    depth = _depth(outline, anatomy, x, y)
    inner = depth < 1.0 - SKIN_PART
    gland = inner & (depth + GLAND_WAVINESS * lobes.at(x, y) < anatomy.gland_part)
    return inner, gland, texture.at(x, y), depth


def _painted(
    fields: tuple[Waves, Waves, Waves, Waves],
    anatomy: Anatomy,
    x: Floats,
    y: Floats,
    quantity: int,
    outside: float,
) -> Floats:
    """Speed (quantity 0) or attenuation (1) at all pairs of coordinates, (len(x), len(y))."""
    inner, gland, grain, depth = _tissues(fields, anatomy, x, y)
    varied = fields[3].at(x, y) if quantity == 0 else np.zeros_like(grain)

    def of(tissue: Tissue) -> Floats:
        return (
            tissue.speed_mps + tissue.variation_mps * varied
            if quantity == 0
            else np.full_like(varied, tissue.attenuation_np_m)
        )

    painted = np.where(depth < 1.0, of(SKIN), outside)
    painted = np.where(inner, np.where(np.abs(grain) < 0.05, of(LIGAMENT), of(FAT)), painted)
    painted = np.where(gland, np.where(grain > anatomy.lobule_level, of(GLAND), of(LOBULE)), painted)
    for lesion in anatomy.lesions:
        value = (lesion.speed_mps, lesion.attenuation_np_m)[quantity]
        painted[lesion.contains(x[:, None], y[None, :])] = value
    return painted

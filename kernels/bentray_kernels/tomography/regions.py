"""Statistics of a region of an image: mean, spread, size, contrast to its surroundings, uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import refuse_mask
from ..errors import InvalidInput

Bools = NDArray[np.bool_]

# The surroundings of a round region: a shell between these multiples of its radius. The gap leaves out
# nodes that a blurred edge mixes.
INNER, OUTER = 1.25, 2.0


@dataclass(frozen=True)
class RoundRegion:
    """A disc of a slice or a ball of a volume.

    Attributes:
        centre_m: (x, y[, z]), m.
        radius_m: > 0, m.

    Raises:
        InvalidInput: naming the field.
    """

    centre_m: tuple[float, ...]
    radius_m: float

    def __post_init__(self) -> None:
        if len(self.centre_m) not in (2, 3) or not all(map(math.isfinite, self.centre_m)):
            raise InvalidInput("centre_m", self.centre_m, "x, y[, z] in m")
        if not 0.0 < self.radius_m < math.inf:
            raise InvalidInput("radius_m", self.radius_m, "a radius > 0 m")

    def nodes(
        self, shape: Sequence[int], spacing_m: Sequence[float], origin_m: Sequence[float]
    ) -> tuple[Bools, Bools]:
        """Nodes of the region and of its surroundings, booleans of ``shape`` each.

        Args:
            shape: (nx, ny[, nz]).
            spacing_m, origin_m: of the nodes per axis, m.

        Raises:
            InvalidInput: for a centre with another number of coordinates, uneven slices, or a region without
                a node.
        """
        if len(self.centre_m) != len(shape):
            raise InvalidInput("centre_m", self.centre_m, f"{len(shape)} coordinates in m, as the image has")
        if not (np.isfinite(spacing_m).all() and np.isfinite(origin_m).all()):
            raise InvalidInput("region", "one of a volume of uneven slices", "evenly spaced slices")
        grid = zip(shape, spacing_m, origin_m, self.centre_m, strict=True)
        lines = np.ix_(*(start + step * np.arange(n) - centre for n, step, start, centre in grid))
        away = np.sqrt(sum(line**2 for line in lines))
        inside = away <= self.radius_m
        if not inside.any():
            raise InvalidInput("region", f"{self}, between all nodes", "a region with at least one node")
        return inside, (away > INNER * self.radius_m) & (away <= OUTER * self.radius_m)

    def __str__(self) -> str:
        centre = ", ".join(f"{1e3 * x:g}" for x in self.centre_m)
        return f"({centre}) mm, radius {1e3 * self.radius_m:g} mm"


def round_nodes(
    centre_m: Sequence[float] | None,
    radius_m: float | None,
    shape: Sequence[int],
    spacing_m: Sequence[float],
    origin_m: Sequence[float],
) -> tuple[Bools, Bools] | None:
    """Nodes of a disc or ball and of its surroundings; None without one.

    Raises:
        InvalidInput: naming ``centre_m`` or ``radius_m``, also if only one of them is given.
    """
    if centre_m is None and radius_m is None:
        return None
    if centre_m is None or radius_m is None:
        missing = "centre_m" if centre_m is None else "radius_m"
        raise InvalidInput(missing, "none", "both centre_m and radius_m, or neither")
    region = RoundRegion(tuple(float(x) for x in centre_m), float(radius_m))
    return region.nodes(shape, spacing_m, origin_m)


@dataclass(frozen=True)
class RegionStatistics:
    """The values of an image in a region.

    Attributes:
        nodes: number of nodes.
        size: area, m², or volume, m³; NaN for uneven slices.
        mean: of the values.
        spread: their standard deviation.
        contrast: mean minus that of the surroundings; None without surroundings.
        contrast_to_noise: |contrast| over the standard deviation in the surroundings; None without, or if
            they are constant.
        uncertainty: of the mean: the mean standard deviation of the nodes, as if their errors were fully
            correlated, so that the mean is not better known than a node; None if it is not known.
    """

    nodes: int
    size: float
    mean: float
    spread: float
    contrast: float | None = None
    contrast_to_noise: float | None = None
    uncertainty: float | None = None


def region_statistics(
    values: ArrayLike,
    region: Bools,
    spacing_m: Sequence[float],
    surroundings: Bools | None = None,
    uncertainty: ArrayLike | None = None,
) -> RegionStatistics:
    """Statistics over the nodes of a region that have a value.

    Args:
        values: (nx, ny[, nz]); NaN: no value.
        region: nodes of the region, of that shape.
        spacing_m: of the nodes per axis, m.
        surroundings: nodes to compare with, None or none: no contrast.
        uncertainty: standard deviation of each node, in the unit of the values.

    Raises:
        InvalidInput: for a region without a value.
    """
    refuse_mask("values", values)
    image = np.asarray(values, np.float64)
    finite = np.isfinite(image)
    inside = region & finite
    if not inside.any():
        raise InvalidInput("region", "no node with a value", "a region that overlaps the image")
    mean = float(image[inside].mean())
    contrast = ratio = None
    if surroundings is not None and (outside := surroundings & finite).any():
        contrast, noise = mean - float(image[outside].mean()), float(image[outside].std())
        ratio = abs(contrast) / noise if noise > 0.0 else None
    deviation = None if uncertainty is None else float(np.mean(np.asarray(uncertainty)[inside]))
    return RegionStatistics(
        nodes=int(inside.sum()),
        size=float(inside.sum() * math.prod(spacing_m)),
        mean=mean,
        spread=float(image[inside].std()),
        contrast=contrast,
        contrast_to_noise=ratio,
        uncertainty=deviation,
    )

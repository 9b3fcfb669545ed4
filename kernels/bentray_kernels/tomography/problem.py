"""The inverse problem of a slice or volume: transducers in the coordinates of a grid, data per emitter."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..acquisition import Dataset
from ..acquisition.array_hull import POSITION, check_extent, inside_array
from ..arrays import Flags, Floats, Ints
from ..errors import InvalidInput
from . import pairs
from .requirements import check_bounds
from .roi import inside
from .settings import Settings

# Water kept around the outermost transducer, nodes, as a margin for wave front and gradient.
MARGIN_NODES = 3

# Nodes nearer to the array than this are water and stay so.
RIM_NODES = 2


@dataclass(frozen=True, kw_only=True)
class Problem(pairs.Pairs):
    """Pairs of a reconstruction, node 0 at 0, on a grid; ``ndim`` is 2 for a slice and 3 for a volume.

    Attributes:
        region: (nodes, nodes[, heights]), nodes that may change.
        spacing: node spacing, m.
        origin: position of node 0 in the dataset's coordinates, m.
        water_speed: m/s.
        water_attenuation: Np/m.
        wavelength_m: in water, of the amplitudes; None if their frequency is unknown.
    """

    region: Flags
    spacing: float
    origin: tuple[float, ...]
    water_speed: float
    water_attenuation: float = 0.0
    wavelength_m: float | None = None

    @classmethod
    def from_dataset(cls, dataset: Dataset, settings: Settings, index: int = 0) -> Problem:
        """One problem of a dataset; ``index`` counts slices from 0 (a volume has one problem).

        Raises:
            InvalidInput: no travel times in the slice, elements on one line or outside the image, an image
                without a node inside the array, bounds that exclude the water, a region of interest without
                a grid or a node.
        """
        check_bounds(settings, dataset.water_speed_mps)
        data = pairs.from_dataset(dataset, settings, index)
        elements = data.elements
        check_extent(elements)
        flat = dataset.element_position_m[:, :2]
        centre = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
        reach = float(np.abs(flat - centre).max())
        side = settings.side_m
        if side is None:
            side = image_side(dataset, settings.grid_nodes)
        if side < 2.0 * reach:
            raise InvalidInput("side_m", side, f"at least {2.0 * reach:g} m, to hold the array")
        spacing = side / (settings.grid_nodes - 1)
        shape: tuple[int, ...] = (settings.grid_nodes,) * 2
        origin = centre - 0.5 * side
        if data.emitters.shape[1] == 3:
            z = np.concatenate((data.emitters[:, 2], data.receivers[..., 2].ravel()))
            count = math.ceil((z.max() - z.min()) / spacing - 1e-6) + 1 + 2 * MARGIN_NODES
            origin = np.append(origin, z.min() - MARGIN_NODES * spacing)
            shape = (*shape, count)
        # Coarse grids of a thin array have nodes inside it, but none so far inside.
        rims = (RIM_NODES, 0.5 * RIM_NODES, 0.0)
        regions = (inside_array(elements, shape, spacing, origin, rim) for rim in rims)
        region = next((mask for mask in regions if mask.any()), None)
        if region is None:
            raise InvalidInput(
                POSITION,
                f"no node inside the array: nodes {spacing:.3g} m apart, array {2.0 * reach:.3g} m wide",
                "elements around the object, and nodes (settings nodes, side_m) between them",
            )
        corner = tuple(float(x) for x in origin)
        frequency = dataset.amplitude_frequency_hz or dataset.center_frequency_hz
        if settings.roi:
            heights = pairs.heights(dataset)
            height = None if heights is None or len(corner) == 3 else float(heights[index])
            region &= inside(dataset, region.shape, spacing, corner, height)
            # A slice above or below a 3-D region stays water; the other slices are reconstructed.
            if not region.any() and (height is None or dataset.roi is None or dataset.roi.ndim == 2):
                raise InvalidInput(
                    "mask/roi", "no node of the image", "a region of interest with nodes inside the array"
                )
        return cls(
            **vars(replace(data, emitters=data.emitters - origin, receivers=data.receivers - origin)),
            region=region,
            spacing=spacing,
            origin=corner,
            water_speed=dataset.water_speed_mps,
            water_attenuation=dataset.water_attenuation_np_m or 0.0,
            wavelength_m=None if frequency is None else dataset.water_speed_mps / frequency,
        )

    @property
    def active_emitters(self) -> Ints:
        """Emitters with travel times."""
        return np.flatnonzero(np.isfinite(self.delta_tof).any(axis=1))

    def mean_in_region(self, image: Floats) -> float:
        """Mean of an image over the nodes that may change; 0 where none may."""
        inside = image[self.region]
        return float(inside.mean()) if inside.size else 0.0

    @property
    def longest_m(self) -> float:
        """Longest distance between an emitter and a receiver of its ring, m."""
        pairs_of = ((self.receivers_of(k), at) for k, at in enumerate(self.emitters))
        return max(float(np.linalg.norm(other - at, axis=1).max()) for other, at in pairs_of)

    def receivers_of(self, emitter: int) -> Floats:
        """(nrx, ndim), m: receivers of the emitter's row of the data."""
        return np.asarray(self.receivers[self.ring[emitter]])

    def each_pair_once(self) -> Problem:
        """This problem without reverse pairs, if every element is emitter and receiver: half the rays.

        Pairs measured both ways have their mean. Each emitter keeps the half of the elements that follow it,
        as if they were in a circle, in an array of any shape.
        """
        members = [np.flatnonzero(self.ring == k) for k in range(len(self.receivers))]
        for k, of_ring in enumerate(members):
            at, other = self.emitters[of_ring], self.receivers[k]
            if at.shape != other.shape or (at != other).any():
                return self

        def once(data: Floats) -> Floats:
            halves = np.empty_like(data)
            for of_ring in members:
                halves[of_ring] = _once(data[of_ring])
            return halves

        ratio = None if self.log_ratio is None else once(self.log_ratio)
        there = (np.isfinite(self.delta_tof[of_ring]) for of_ring in members)
        twice = any(np.triu(known & known.T, 1).any() for known in there)
        # The mean of two times has half the variance.
        noise = self.noise_s / math.sqrt(2.0) if twice else self.noise_s
        return replace(self, delta_tof=once(self.delta_tof), log_ratio=ratio, noise_s=noise)


def image_side(dataset: Dataset, nodes: int) -> float:
    """Side of an image of so many nodes that holds the array and its margin, m."""
    flat = dataset.element_position_m[:, :2]
    reach = float(np.abs(flat - 0.5 * (flat.min(axis=0) + flat.max(axis=0))).max())
    return 2.0 * reach * (nodes - 1) / (nodes - 1 - 2 * MARGIN_NODES)


def _once(data: Floats) -> Floats:
    """The matrix of one ring with each pair in one of its two places, NaN in the other."""
    count = len(data)
    ahead = (np.arange(count)[None, :] - np.arange(count)[:, None]) % count
    half = (2 * ahead < count) & (ahead > 0)
    if count % 2 == 0:
        half |= (2 * ahead == count) & np.triu(np.ones((count, count), dtype=np.bool_))
    both = np.where(np.isfinite(data), data, data.T)
    mean = np.where(np.isfinite(data.T), 0.5 * (both + data.T), both)
    return np.where(half, mean, np.nan)

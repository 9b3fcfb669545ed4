"""Input of every tomography peer: travel times of pairs, and the grid of the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bentray_kernels.acquisition import Dataset

# Nodes nearer to the ring than this are water, as in a reconstruction of ours.
RIM_NODES = 2


@dataclass(frozen=True)
class TravelTimes:
    """A slice's data and its grid; node (0, 0) lies at 0, images are (x, y).

    Attributes:
        emitters, receivers: (n, 2) and (m, 2), m.
        delta_tof: (n, m), s, object minus water; NaN where there is none.
        water_speed: m/s.
        region: (nodes, nodes), nodes that may differ from water.
        spacing: m.
    """

    emitters: np.ndarray
    receivers: np.ndarray
    delta_tof: np.ndarray
    water_speed: float
    region: np.ndarray
    spacing: float

    @classmethod
    def from_dataset(cls, dataset: Dataset, nodes: int, side_m: float) -> TravelTimes:
        """The times of a ring of which all or some elements send and receive, in a square centred on 0.

        A pair measured both ways keeps the mean, in one of its places: twice the rays would cost twice the
        time and tell nothing more. Each emitter keeps the half of the ring that follows it, and the pairs
        that were measured in its direction alone.
        """
        position = dataset.element_position_m + 0.5 * side_m
        assert dataset.delta_tof_s is not None
        count = len(position)
        every = np.full((count, count), np.nan)
        every[np.ix_(dataset.tx, dataset.rx)] = dataset.delta_tof_s
        ahead = (np.arange(count) - np.arange(count)[:, None]) % count
        opposite = np.triu(2 * ahead == count)
        first = ((ahead > 0) & (2 * ahead < count)) | opposite
        mean = np.where(np.isfinite(every.T), 0.5 * (every + every.T), every)
        kept = first | (np.isnan(every.T) & (ahead > 0))
        spacing = side_m / (nodes - 1)
        axis = np.linspace(-0.5 * side_m, 0.5 * side_m, nodes)
        reach = np.linalg.norm(dataset.element_position_m, axis=1).min() - RIM_NODES * spacing
        return cls(
            emitters=position[dataset.tx],
            receivers=position[dataset.rx],
            delta_tof=np.where(kept, mean, np.nan)[np.ix_(dataset.tx, dataset.rx)],
            water_speed=dataset.water_speed_mps,
            region=np.hypot(axis[:, None], axis[None, :]) <= reach,
            spacing=spacing,
        )

    @property
    def side_m(self) -> float:
        """Distance of the first from the last node, m."""
        return self.spacing * (len(self.region) - 1)

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Emitter and receiver of each pair with a travel time, emitter by emitter; each (pairs,)."""
        emitter, receiver = np.nonzero(np.isfinite(self.delta_tof))
        return emitter, receiver

    def speed(self, change: np.ndarray) -> np.ndarray:
        """(nodes, nodes), m/s, where the slowness of the region's nodes differs from water by ``change``."""
        slowness = np.full(self.region.shape, 1.0 / self.water_speed)
        slowness[self.region] += change
        return np.asarray(1.0 / slowness)

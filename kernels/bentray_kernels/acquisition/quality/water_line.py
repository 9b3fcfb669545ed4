"""Line fit of time over distance in water: sampling rate, time zero, and residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..robust_line import MIN_POINTS, robust_line

# Nearer pairs than this part of the longest contain cross-talk and the near field.
NEAR = 0.25


@dataclass(frozen=True)
class WaterLine:
    """Time of the maximum of the pulse = intercept + distance / speed.

    Attributes:
        speed_mps: apparent speed of the water.
        intercept_s: delay of the maximum after the straight time, including that of the pulse.
        residual_s: (ntx, nrx), from the line of the stated water speed, minus the median.
    """

    speed_mps: float
    intercept_s: float
    residual_s: Floats

    def departures(self, dataset: Dataset, strongest_s: Floats) -> Floats:
        """Times minus the line with its own speed, (ntx, nrx), s; NaN for near pairs and without a time."""
        distance = dataset.distance_m()
        late = strongest_s - distance / self.speed_mps
        return np.where(distance > NEAR * distance.max(), late, np.nan)

    @classmethod
    def from_dataset(cls, dataset: Dataset, strongest_s: Floats) -> WaterLine | None:
        """The line through the water maxima; None with too few of them.

        Args:
            dataset: of one slice.
            strongest_s: (ntx, nrx), NaN where there is none.
        """
        distance = dataset.distance_m()
        usable = np.isfinite(strongest_s) & (distance > NEAR * distance.max())
        if usable.sum() < MIN_POINTS or np.ptp(distance[usable]) == 0.0:
            return None
        x, y = distance[usable], strongest_s[usable]
        slope, _ = robust_line(x, y)
        late = strongest_s - distance / dataset.water_speed_mps
        residual = np.where(usable, late - np.median(late[usable]), np.nan)
        speed = 1.0 / slope if slope > 0.0 else np.inf
        return cls(float(speed), float(np.median(late[usable])), residual)

"""Line fit of time over distance in water: sampling rate, time zero, and residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..noise import robust_deviation

# Iterations of a line fit to the points within four robust deviations of the previous line.
ROUNDS = 6
FEWEST = 8


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

    @classmethod
    def of(cls, dataset: Dataset, strongest_s: Floats) -> WaterLine | None:
        """The line through the water maxima; None with too few of them.

        Args:
            dataset: of one slice.
            strongest_s: (ntx, nrx), NaN where there is none.
        """
        distance = dataset.distance_m()
        known = np.isfinite(strongest_s) & (distance > 0.25 * distance.max())
        if known.sum() < FEWEST or np.ptp(distance[known]) == 0.0:
            return None
        x, y = distance[known], strongest_s[known]
        slope, _ = _robust_line(x, y)
        late = strongest_s - distance / dataset.water_speed_mps
        residual = np.where(known, late - np.median(late[known]), np.nan)
        speed = 1.0 / slope if slope > 0.0 else np.inf
        return cls(float(speed), float(np.median(late[known])), residual)


def _robust_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope and intercept: the median slope of many pairs of points, then least squares without outliers."""
    order = np.argsort(x, kind="stable")
    half = len(x) // 2
    near, far = order[:half], order[-half:]
    run = x[far] - x[near]
    slope = float(np.median((y[far] - y[near])[run > 0.0] / run[run > 0.0])) if (run > 0.0).any() else 0.0
    intercept = float(np.median(y - slope * x))
    for _ in range(ROUNDS):
        off = y - slope * x - intercept
        inliers = np.abs(off - np.median(off)) <= 4.0 * robust_deviation(off) + 1e-12
        if inliers.sum() < FEWEST or np.ptp(x[inliers]) == 0.0:
            break
        slope, intercept = (float(v) for v in np.polyfit(x[inliers], y[inliers], 1))
    return slope, intercept

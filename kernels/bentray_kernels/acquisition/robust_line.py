"""Straight line through points with outliers."""

import numpy as np

from ..arrays import Floats
from .noise import robust_deviation

# Iterations of a line fit to the points within some robust deviations of the previous line.
ROUNDS, NEAR = 6, 4.0

# Fewest points of a line, and least part of the width of all of them.
MIN_POINTS, SPAN = 8, 1e-6


def robust_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope and intercept: the median slope of many pairs of points, then least squares without outliers.

    Args:
        x, y: (points,), at least two.
    """
    order = np.argsort(x, kind="stable")
    half = len(x) // 2
    run, rise = (values[order[-half:]] - values[order[:half]] for values in (x, y))
    # Equal distances differ by rounding.
    least = SPAN * float(np.ptp(x))
    apart = run > least
    slope = float(np.median(rise[apart] / run[apart])) if apart.any() else 0.0
    intercept = float(np.median(y - slope * x))
    for _ in range(ROUNDS):
        off = y - slope * x - intercept
        inliers = np.abs(off - np.median(off)) <= NEAR * robust_deviation(off) + 1e-12
        if inliers.sum() < MIN_POINTS or not np.ptp(x[inliers]) > least:
            break
        middle = x[inliers].mean()
        slope = float((x[inliers] - middle) @ y[inliers] / ((x[inliers] - middle) ** 2).sum())
        intercept = float(y[inliers].mean() - slope * middle)
    return slope, intercept

"""Huber's loss: residuals beyond a limit count by their size, so that outliers do not decide."""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Floats

# The median of |x| over the standard deviation of x, for a normal distribution.
MEDIAN_PART = 0.6745

# The limit is at least this part of the mean size. Of a small object in exact times most rays pass nothing
# but water and fit from the start; if only these set the spread, the other rays would have no weight.
LEAST_PART = 0.7


def limit(residual: Floats, spreads: float) -> float:
    """Beyond which residuals count by their size, in their unit.

    Args:
        residual: any number of them.
        spreads: how many of their standard deviations; 0: none is beyond.
    """
    if spreads == 0.0:
        return math.inf
    size = np.abs(residual)
    spread = float(np.median(size)) / MEDIAN_PART
    # All residuals zero: none is an outlier.
    return max(spreads * spread, LEAST_PART * float(size.mean())) or math.inf


def loss(residual: Floats, limit: float) -> float:
    """As a root mean square, which it is for residuals within the limit; the others add less to it."""
    size = np.abs(residual)
    inner = np.minimum(size, limit)
    outer = np.maximum(size - limit, 0.0)
    return math.sqrt(float((inner * (inner + 2.0 * outer)).mean()))


def clipped_rms(residual: Floats, limit: float) -> float:
    """Root mean square of residuals of which none counts as more than the limit."""
    return math.sqrt(float((np.minimum(np.abs(residual), limit) ** 2).mean()))

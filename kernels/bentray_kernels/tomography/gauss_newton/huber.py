"""Huber loss: linear instead of quadratic beyond a limit, so that outliers have less weight."""

import math

import numpy as np

from ...arrays import Floats

# The median of |x| over the standard deviation of x, for a normal distribution.
MEDIAN_PART = 0.6745

# The limit is at least this part of the mean absolute residual. With exact times of a small object most rays
# cross only water and fit from the start; if only these determined the spread, the others would have no
# weight.
MIN_FRACTION = 0.7


def limit(residual: Floats, spreads: float) -> float:
    """The limit of the quadratic part, in the unit of the residuals.

    Args:
        residual: any number of residuals.
        spreads: the limit in standard deviations; 0: no limit.
    """
    if spreads == 0.0:
        return math.inf
    size = np.abs(residual)
    spread = float(np.median(size)) / MEDIAN_PART
    # If all residuals are zero, none is an outlier.
    return max(spreads * spread, MIN_FRACTION * float(size.mean())) or math.inf


def loss(residual: Floats, limit: float) -> float:
    """Root mean square, with less weight for residuals beyond the limit."""
    size = np.abs(residual)
    inner = np.minimum(size, limit)
    outer = np.maximum(size - limit, 0.0)
    return math.sqrt(float((inner * (inner + 2.0 * outer)).mean()))


def weights(residual: Floats, limit: float) -> Floats:
    """Weights of residuals in the loss: 1, less beyond the limit."""
    if limit == math.inf:
        return np.ones_like(residual)
    return np.asarray(limit / np.maximum(np.abs(residual), limit))


def clipped_rms(residual: Floats, limit: float) -> float:
    """Root mean square of the residuals clipped to the limit."""
    return math.sqrt(float((np.minimum(np.abs(residual), limit) ** 2).mean()))

"""Binary morphologic cell classification: the range of the coefficients that reach a cell (4.3.2.1)."""

import math
from typing import Any

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel
from ..splines.spline import Spline
from .cell_weights import CellWeights


def support_ranges(spline: Spline, weights: CellWeights) -> tuple[Floats, Floats]:
    """Least and greatest coefficient in the closed support of the filter about every cell.

    Dilation less erosion of the coefficients above an iso-value flags a cell exactly where that value lies
    between the two; so one pair of arrays holds the classification for every iso-value. For the cubic
    B-spline the support has 6³ nodes.

    Args:
        spline: (nx, ny, nz) nodes.
        weights: of its filter. Where some are negative, as of Catmull-Rom, values leave the range of the
            coefficients by as much as the sum of absolute weights exceeds 1; the range is widened by that.

    Returns:
        Two arrays of the cells, (nx − 1, ny − 1, nz − 1), unit of the coefficients.
    """
    low: Any = spline.coefficients
    high: Any = spline.coefficients
    for axis, stored in enumerate(spline.coefficients.shape):
        cells = spline.shape[axis] - 1
        start = spline.pad + weights.first - weights.margin
        count = weights.nodes + 2 * weights.margin
        lead, trail = math.prod(low.shape[:axis]), math.prod(low.shape[axis + 1 :])
        shape = (*low.shape[:axis], cells, *low.shape[axis + 1 :])
        lines = (low.reshape(lead, stored, trail), high.reshape(lead, stored, trail))
        low, high = np.empty((lead, cells, trail)), np.empty((lead, cells, trail))
        _windows(*lines, start, count, low, high)
        low, high = low.reshape(shape), high.reshape(shape)
    excess = weights.total() ** 3 - 1.0
    if excess > 0.0:
        widening = 0.5 * excess * (high - low)
        low, high = low - widening, high + widening
    return low, high


@kernel
def _windows(lows: Floats, highs: Floats, start: int, count: int, low: Floats, high: Floats) -> None:
    """Along the middle axis: extremes of nodes i + start … i + start + count − 1, as far as there are any."""
    outer, stored, inner = lows.shape
    for o in range(outer):
        for i in range(low.shape[1]):
            first, last = max(i + start, 0), min(i + start + count, stored)
            for x in range(inner):
                low[o, i, x] = lows[o, first, x]
                high[o, i, x] = highs[o, first, x]
            for k in range(first + 1, last):
                for x in range(inner):
                    low[o, i, x] = min(low[o, i, x], lows[o, k, x])
                    high[o, i, x] = max(high[o, i, x], highs[o, k, x])

"""Approximate continuous cell classification: each coefficient times the extremes of its weight (4.3.2.3)."""

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel
from .cell_weights import CellWeights

# Newton's steps on a convex, piecewise linear function seldom number more than five.
STEPS = 40


def product_ranges(weights: CellWeights, divisions: int) -> tuple[Floats, Floats]:
    """Least and greatest weight in space of each node, for each of divisions³ parts of the cell.

    Returns:
        Two arrays (divisions³, nodes³), nodes in C order.
    """
    low, high = weights.ranges(divisions)
    lows, highs = [], []
    for p in np.ndindex(divisions, divisions, divisions):
        least, most = low[p[0]], high[p[0]]
        for division in p[1:]:
            ends = [np.multiply.outer(a, b) for a in (least, most) for b in (low[division], high[division])]
            least, most = np.minimum.reduce(ends), np.maximum.reduce(ends)
        lows.append(least.ravel())
        highs.append(most.ravel())
    return np.array(lows), np.array(highs)


@kernel
def weighted_range(nodes: Floats, least: Floats, most: Floats) -> tuple[float, float]:
    """Range of a cell's values by equation 18, for all iso-values at once.

    Equation 18 bounds f by iso + Σ (c − iso)·w, the weights at their extremes. The cell may reach an
    iso-value from below where that bound is not less than the iso-value itself; the greatest such
    iso-value is the greatest value of the cell within the accuracy of ACCC, for every iso-value. It is
    found by Newton's method on h(r) = Σ (c − r)⁺·most − Σ (r − c)⁺·least, which is convex.

    Args:
        nodes: (n³,) coefficients.
        least: (parts, n³) least weights.
        most: (parts, n³) greatest weights.

    Returns:
        Least and greatest value over all parts.
    """
    low, high = np.inf, -np.inf
    for part in range(len(least)):
        high = max(high, _upper(nodes, least[part], most[part], 1.0))
        low = min(low, -_upper(nodes, least[part], most[part], -1.0))
    return low, high


@kernel(inline="always")
def _upper(nodes: Floats, least: Floats, most: Floats, sign: float) -> float:
    """Upper bound of sign·f."""
    reference = np.inf
    for k in range(len(nodes)):
        reference = min(reference, sign * nodes[k])
    excess = 0.0
    for _ in range(STEPS):
        excess, weight = 0.0, 0.0
        for k in range(len(nodes)):
            above = sign * nodes[k] - reference
            w = most[k] if above > 0.0 else least[k]
            excess += above * w
            weight += w
        # Without a root, or at it: reference + excess bounds f whatever the reference is.
        if weight <= 0.0 or excess <= 1e-14 * weight * (abs(reference) + 1e-300):
            break
        reference += excess / weight
    return reference + excess

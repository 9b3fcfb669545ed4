"""Extrema between three samples: by a parabola, or by a cosine for a correlation."""

from __future__ import annotations

import math

from ...compilation.compiled import kernel


@kernel(inline="always")
def vertex(left: float, middle: float, right: float) -> float:
    """Position of the extremum of the parabola through (−1, left), (0, middle), (1, right)."""
    bend = left - 2.0 * middle + right
    return 0.5 * (left - right) / bend if bend != 0.0 and math.isfinite(bend) else 0.0


@kernel(inline="always")
def crest(left: float, middle: float, right: float) -> tuple[float, float]:
    """Position and height of the maximum of the cosine through (−1, left), (0, middle), (1, right).

    The autocorrelation of a pulse is a cosine near its maximum; with few samples per period a parabola
    underestimates the height.
    """
    turn = math.acos(min(max((left + right) / (2.0 * middle), -1.0), 1.0))
    if turn < 1e-9:
        return 0.0, middle
    phase = math.atan2(right - left, 2.0 * middle * math.sin(turn))
    return phase / turn, middle / math.cos(phase)

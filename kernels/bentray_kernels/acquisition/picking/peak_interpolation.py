"""Extrema between three samples: a parabola for any curve, a cosine for a likeness."""

from __future__ import annotations

import math

from ...compiled import kernel


@kernel(inline="always")
def vertex(left: float, middle: float, right: float) -> float:
    """Place of the extremum of the parabola through (−1, left), (0, middle), (1, right)."""
    bend = left - 2.0 * middle + right
    return 0.5 * (left - right) / bend if bend != 0.0 and math.isfinite(bend) else 0.0


@kernel(inline="always")
def crest(left: float, middle: float, right: float) -> tuple[float, float]:
    """Place and height of the crest of the cosine through (−1, left), (0, middle), (1, right).

    The likeness of a pulse with itself is a cosine near its crest; at few samples a period a parabola
    would miss the height, and a true copy would look unlike by its sampling alone.
    """
    turn = math.acos(min(max((left + right) / (2.0 * middle), -1.0), 1.0))
    if turn < 1e-9:
        return 0.0, middle
    phase = math.atan2(right - left, 2.0 * middle * math.sin(turn))
    return phase / turn, middle / math.cos(phase)

"""Swapped channels: two elements whose water times fit each other's positions."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from .finding import ROLES, Finding

# An element is suspected if the deviations of its times exceed this fraction of a period and this multiple of
# the usual deviation.
SUSPECT_PERIODS = 0.15
SUSPECT_TIMES = 4.0

# After an exchange, the deviations of both must fall below this fraction of the previous ones.
BETTER = 0.4


def find_swapped(dataset: Dataset, strongest_s: Floats, expected_s: Floats) -> Iterator[Finding]:
    """Find pairs of swapped channels, first receivers, then emitters.

    Args:
        dataset: of one slice, with a centre frequency.
        strongest_s: (ntx, nrx), times of the maxima of envelopes.
        expected_s: (ntx, nrx), these times in water, for the stated positions; NaN for pairs not in water.
    """
    period = 1.0 / dataset.frequency_hz
    sides = (dataset.tx, strongest_s.T, expected_s.T), (dataset.rx, strongest_s, expected_s)
    for role, (element, times, expected) in reversed(list(zip(ROLES, sides, strict=True))):
        for a, b, before in _exchanged(times, expected, period):
            yield Finding(
                "swapped channels",
                f"elements {element[a]} and {element[b]} fit each other's places in {role}",
                "water times that fit an element's own position",
                "corrected",
                (int(element[a]), int(element[b])),
                role,
                value=before,
                unit="s, present deviation",
            )


def _exchanged(times: Floats, expected: Floats, period: float) -> list[tuple[int, int, float]]:
    """Columns (a, b) to exchange, and their present deviation."""
    own = np.array([_scatter(times[:, r] - expected[:, r]) for r in range(times.shape[1])])
    finite = np.isfinite(own)
    if not finite.any():
        return []
    least = max(SUSPECT_PERIODS * period, SUSPECT_TIMES * float(np.median(own[finite])))
    suspects = np.flatnonzero(finite & (own > least))
    candidates = []
    for a, b in combinations(suspects.tolist(), 2):
        there, back = _scatter(times[:, a] - expected[:, b]), _scatter(times[:, b] - expected[:, a])
        if max(there, back) < BETTER * min(own[a], own[b]):
            candidates.append((max(there, back) / min(own[a], own[b]), a, b))
    taken: set[int] = set()
    swaps = []
    for _, a, b in sorted(candidates):
        if not taken & {a, b}:
            taken |= {a, b}
            swaps.append((a, b, float(max(own[a], own[b]))))
    return swaps


def _scatter(off: Floats) -> float:
    """Median absolute deviation of an element's times; NaN where few are known."""
    off = off[np.isfinite(off)]
    return float(np.median(np.abs(off))) if off.size >= 4 else np.nan

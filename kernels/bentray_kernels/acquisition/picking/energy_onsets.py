"""Energy-based onset pickers: Coppens' energy ratio, and short-term over long-term average (STA/LTA)."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compilation.compiled import kernel

Trace = NDArray[Any]

# Coppens' stabilisation, fraction of the total energy: without it the first noisy sample has the highest
# ratio.
COPPENS_PART = 0.2

# Lengths of both averages, periods, and floor of the long one as an amplitude, fraction of the peak.
LONG_PERIODS = 4.0
SHORT_PERIODS = 0.5
LONG_FLOOR = 0.02

# The onset is where a ratio first reaches this fraction of its maximum. Its steepest rise, which Coppens
# uses, jumps between cycles of the pulse.
RISEN = 0.5


@kernel
def energy_ratio(x: Trace, begin: int, end: int, period: float) -> float:
    """Onset at half the maximum ratio of the energy of the last period to all energy so far; NaN if none.

    F. Coppens, "First arrival picking on common-offset trace collections for automatic estimation of static
    corrections", Geophysical Prospecting 33 (1985) 1212-1231.
    """
    n = end - begin
    window = max(1, math.ceil(period))
    if n < 4:
        return np.nan
    before = energies(x, begin, n)
    ratio = np.empty(n)
    for i in range(n):
        recent = before[i + 1] - before[max(0, i + 1 - window)]
        ratio[i] = recent / (before[i + 1] + COPPENS_PART * before[n])
    return begin + risen(ratio, 0)


@kernel
def sta_lta(x: Trace, begin: int, end: int, period: float) -> float:
    """Onset at half the maximum ratio of the short-term to the preceding long-term average; NaN if none.

    R. V. Allen, "Automatic earthquake recognition and timing from single traces", Bulletin of the
    Seismological Society of America 68 (1978) 1521-1532.
    """
    n = end - begin
    short, long = max(1, math.ceil(SHORT_PERIODS * period)), max(1, math.ceil(LONG_PERIODS * period))
    # The long average needs at least the length of the short one.
    known = 2 * short
    if n < known + 4:
        return np.nan
    before = energies(x, begin, n)
    peak = 0.0
    for i in range(n):
        peak = max(peak, abs(x[begin + i]))
    ratio = np.zeros(n)
    for i in range(known, n):
        start = i + 1 - short
        first = max(0, start - long)
        quiet = (before[start] - before[first]) / (start - first)
        ratio[i] = (before[i + 1] - before[start]) / short / (quiet + (LONG_FLOOR * peak) ** 2)
    return begin + risen(ratio, known)


@kernel
def energies(x: Trace, begin: int, n: int) -> Trace:
    """(n + 1,): energy of ``x[begin:begin + k]``."""
    before = np.zeros(n + 1)
    for i in range(n):
        before[i + 1] = before[i] + x[begin + i] ** 2
    return before


@kernel
def risen(ratio: Trace, known: int) -> float:
    """Where ``ratio[known:]`` first reaches the threshold, between samples; NaN if never or at the start."""
    highest = 0.0
    for i in range(known, ratio.size):
        highest = max(highest, ratio[i])
    height = RISEN * highest
    if not height > 0.0 or not ratio[known] < height:
        return np.nan
    i = known + 1
    while ratio[i] < height:
        i += 1
    return float(i - 1 + (height - ratio[i - 1]) / (ratio[i] - ratio[i - 1]))

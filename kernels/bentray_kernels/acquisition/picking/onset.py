"""Onset picking of one trace: noise level, first strong cycle, AIC and threshold onsets.

Traces are (nt,) in any unit; positions and lengths are in samples and may be fractional. The result does not
depend on the unit of a trace, so per-trace scales are not needed.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compilation.compiled import kernel

Trace = NDArray[Any]

# Fewest samples before the arrival for a noise estimate.
LEAD = 16

# Floor of the standard deviations in the AIC, fraction of the peak. Without it the logarithm reacts to the
# first non-zero sample of a noiseless trace, which differs between object and water.
AIC_FLOOR = 0.01

# Threshold: fraction of the peak, or multiple of the noise if that is more.
THRESHOLD_PART = 0.2
THRESHOLD_NOISE = 4.0

# The first arrival is where the trace first reaches this fraction of its peak in the window: later arrivals
# (paths around a lens) may be stronger.
STRONG_PART = 0.5

# Lowest peak of an arrival, standard deviations of the noise.
FAINTEST = 4.0


@kernel
def prepare(trace: Trace, lead: int, rounding: float, out: Trace) -> float:
    """Copy a trace minus its offset to ``out``; returns the noise, NaN where a sample is not finite.

    Offset and noise are the median and the median absolute deviation of the first ``lead`` samples, robust
    against spikes such as the cross-talk of the emission. If the lead is too short, the noise is
    ``rounding``, the standard deviation of the rounding to integers.
    """
    n = trace.size
    for i in range(n):
        out[i] = trace[i]
        if not math.isfinite(out[i]):
            return np.nan
    known = lead >= LEAD
    offset = np.median(out[:lead]) if known else np.median(out)
    for i in range(n):
        out[i] -= offset
    return max(1.4826 * np.median(np.abs(out[:lead])), rounding) if known else rounding


@kernel
def first_strong(x: Trace, begin: int, end: int, period: float, noise: float) -> int:
    """Sample of the largest extremum of the first arrival in ``x[begin:end]``; −1 if there is none."""
    peak = 0.0
    for i in range(begin, end):
        peak = max(peak, abs(x[i]))
    if peak <= FAINTEST * noise or peak == 0.0:
        return -1
    at = begin
    while abs(x[at]) < STRONG_PART * peak:
        at += 1
    best = at
    for i in range(at, min(end, at + math.ceil(period))):
        if abs(x[i]) > abs(x[best]):
            best = i
    return best


@kernel(inline="always")
def vertex(left: float, middle: float, right: float) -> float:
    """Position of the extremum of the parabola through (−1, left), (0, middle), (1, right)."""
    bend = left - 2.0 * middle + right
    return 0.5 * (left - right) / bend if bend != 0.0 and math.isfinite(bend) else 0.0


@kernel
def aic(x: Trace, begin: int, end: int) -> float:
    """Onset that splits ``x[begin:end]`` best into two stationary parts; NaN at the edge of the window.

    AIC(k) = k ln var(before k) + (n − k) ln var(from k), N. Maeda, Zisin 38 (1985) 365-379, with a
    parabola through the lowest three values for the fraction of a sample.
    """
    n = end - begin
    if n < 8:
        return np.nan
    total = 0.0
    square = 0.0
    peak = 0.0
    for i in range(begin, end):
        total += x[i]
        square += x[i] * x[i]
        peak = max(peak, abs(x[i]))
    floor = (AIC_FLOOR * peak) ** 2
    value = np.full(n, np.inf)
    lowest = 2
    left = 0.0
    left_square = 0.0
    for k in range(1, n):
        left += x[begin + k - 1]
        left_square += x[begin + k - 1] ** 2
        if 2 <= k <= n - 2:
            before = max(left_square / k - (left / k) ** 2, 0.0)
            m = n - k
            after = max((square - left_square) / m - ((total - left) / m) ** 2, 0.0)
            value[k] = k * math.log(before + floor) + m * math.log(after + floor)
            if value[k] < value[lowest]:
                lowest = k
    if lowest == 2 or lowest == n - 2:
        return np.nan
    return float(begin + lowest + vertex(value[lowest - 1], value[lowest], value[lowest + 1]))


@kernel
def threshold(x: Trace, begin: int, end: int, noise: float) -> float:
    """Where ``|x[begin:end]|`` first crosses the threshold, between samples; NaN if it starts above."""
    peak = 0.0
    for i in range(begin, end):
        peak = max(peak, abs(x[i]))
    height = max(THRESHOLD_PART * peak, THRESHOLD_NOISE * noise)
    if end - begin < 2 or abs(x[begin]) >= height:
        return np.nan
    for i in range(begin + 1, end):
        if abs(x[i]) >= height:
            low = abs(x[i - 1])
            return float(i - 1 + (height - low) / (abs(x[i]) - low))
    return np.nan

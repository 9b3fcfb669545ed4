"""Delay between the pulses of two traces by cross-correlation, to a fraction of a sample."""

import math

import numpy as np

from ...compilation.compiled import kernel
from .onset import FAINTEST, Trace


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


@kernel
def match_pulse(
    water: Trace, object_: Trace, begin: int, end: int, shift: float, reach: float
) -> tuple[float, float]:
    """Delay near ``shift`` with the highest correlation of ``water[begin:end]``, and the correlation.

    The correlation is normalised, Σwo/√(Σw²Σo²) over equally long segments, so that weak pulses count as
    much; a cosine through the highest three values gives the fraction of a sample. NaN if the maximum lies at
    the edge of ``shift ± reach`` or outside the trace.
    """
    first = math.floor(shift - reach) - 1
    count = math.ceil(shift + reach) + 1 - first + 1
    correlation = correlate(water, object_, begin, end, first, count, 0.0)
    best = int(np.argmax(correlation))
    if best == 0 or best == count - 1 or correlation[best - 1] < -1.5 or correlation[best + 1] < -1.5:
        return np.nan, 0.0
    part, height = crest(correlation[best - 1], correlation[best], correlation[best + 1])
    return first + best + part, min(height, 1.0)


@kernel
def find_delay(
    water: Trace, object_: Trace, begin: int, end: int, early: float, late: float, noise: float
) -> float:
    """Integer delay from ``early`` to ``late`` with the highest correlation of ``water[begin:end]``.

    The noise power is added to the power of the object, so that segments of noise do not win by chance. NaN
    without a positive correlation, or with the maximum at the edge.
    """
    first = math.floor(early)
    count = max(math.ceil(late) + 1 - first, 1)
    least = (end - begin) * (FAINTEST * noise) ** 2
    correlation = correlate(water, object_, begin, end, first, count, least)
    best = int(np.argmax(correlation))
    if correlation[best] <= 0.0 or best == 0 or best == count - 1:
        return np.nan
    return float(first + best)


@kernel
def delay_deviation(correlation: float, period: float, noisy: float, count: int) -> float:
    """Standard deviation of a delay, samples.

    The decorrelation by noise averages out over the pulse, as in the Cramér-Rao bound; other differences,
    such as other paths and changes of the wavelet, may be fully correlated.

    Args:
        correlation: of the two pulses, in (0, 1].
        period: samples.
        noisy: noise power over pulse power, sum of both traces.
        count: independent noise values in the pulse.
    """
    lost = 1.0 - correlation * correlation
    different = max(lost - noisy, 0.0)
    return math.sqrt(different + noisy / count) * period / (2.0 * math.pi * correlation)


@kernel
def noise_fraction(x: Trace, begin: int, end: int, noise: float) -> float:
    """Noise power in ``x[begin:end]`` over the remaining power, at most 1."""
    power = 0.0
    for i in range(begin, end):
        power += x[i] * x[i]
    power = power / (end - begin) - noise * noise
    return min(noise * noise / power, 1.0) if power > 0.0 else 1.0


@kernel
def correlate(
    water: Trace, object_: Trace, begin: int, end: int, first: int, count: int, least: float
) -> Trace:
    """Correlation of ``water[begin:end]`` with the object at delays from ``first``; −2 outside the trace."""
    correlation = np.full(count, -2.0)
    power = 0.0
    for i in range(begin, end):
        power += water[i] * water[i]
    for k in range(count):
        lag = first + k
        if begin + lag >= 0 and end + lag <= object_.size:
            both = 0.0
            other = least
            for i in range(begin, end):
                both += water[i] * object_[i + lag]
                other += object_[i + lag] * object_[i + lag]
            if other > 0.0 and power > 0.0:
                correlation[k] = both / math.sqrt(power * other)
    return correlation

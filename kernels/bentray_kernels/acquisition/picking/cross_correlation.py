"""How far one trace's pulse lies behind another's: by likeness, to a fraction of a sample."""

from __future__ import annotations

import math

import numpy as np

from ...compiled import kernel
from .onset import FAINTEST, Trace
from .peak_interpolation import crest


@kernel
def match(
    water: Trace, object_: Trace, begin: int, end: int, shift: float, reach: float
) -> tuple[float, float]:
    """Delay, near ``shift``, at which ``water[begin:end]`` best resembles the object trace, and how well.

    The likeness is the normalised correlation Σwo/√(Σw²Σo²) of equally long pieces, so a weaker pulse
    counts as much; a cosine through the best three gives the fraction of a sample. NaN when the best lies at
    the rim of ``shift ± reach`` or outside the trace.
    """
    first = math.floor(shift - reach) - 1
    count = math.ceil(shift + reach) + 1 - first + 1
    likeness = likenesses(water, object_, begin, end, first, count, 0.0)
    best = int(np.argmax(likeness))
    if best == 0 or best == count - 1 or likeness[best - 1] < -1.5 or likeness[best + 1] < -1.5:
        return np.nan, 0.0
    part, height = crest(likeness[best - 1], likeness[best], likeness[best + 1])
    return first + best + part, min(height, 1.0)


@kernel
def likeliest(
    water: Trace, object_: Trace, begin: int, end: int, early: float, late: float, noise: float
) -> float:
    """Whole delay from ``early`` to ``late`` at which ``water[begin:end]`` best resembles the object trace.

    Noise counts as power of the object, so that a stretch of it that happens to look alike does not win.
    NaN where nothing resembles it, or the best lies at the rim.
    """
    first = math.floor(early)
    count = max(math.ceil(late) + 1 - first, 1)
    least = (end - begin) * (FAINTEST * noise) ** 2
    likeness = likenesses(water, object_, begin, end, first, count, least)
    best = int(np.argmax(likeness))
    if likeness[best] <= 0.0 or best == 0 or best == count - 1:
        return np.nan
    return float(first + best)


@kernel
def spread(likeness: float, period: float, noisy: float, count: int) -> float:
    """Standard deviation of a delay, samples.

    What of the likeness is lost to noise averages out over the pulse, as in the bound of Cramér and Rao;
    what else differs, other paths and the wavelet's change on its way, may all pull one way.

    Args:
        likeness: of the two pulses, in (0, 1].
        period: samples.
        noisy: power of the noise over that of the pulse, of both traces together.
        count: independent values of the noise in the pulse.
    """
    lost = 1.0 - likeness * likeness
    different = max(lost - noisy, 0.0)
    return math.sqrt(different + noisy / count) * period / (2.0 * math.pi * likeness)


@kernel
def noise_share(x: Trace, begin: int, end: int, noise: float) -> float:
    """Power of the noise in ``x[begin:end]`` over the power that is left without it, at most 1."""
    power = 0.0
    for i in range(begin, end):
        power += x[i] * x[i]
    power = power / (end - begin) - noise * noise
    return min(noise * noise / power, 1.0) if power > 0.0 else 1.0


@kernel
def likenesses(
    water: Trace, object_: Trace, begin: int, end: int, first: int, count: int, least: float
) -> Trace:
    """Likeness of ``water[begin:end]`` with the object at delays from ``first`` on; −2 outside the trace."""
    likeness = np.full(count, -2.0)
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
                likeness[k] = both / math.sqrt(power * other)
    return likeness

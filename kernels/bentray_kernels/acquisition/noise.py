"""Noise of travel times: added to simulated data, estimated in measured data."""

import math
from collections.abc import Callable

import numpy as np

from ..arrays import Flags, Floats
from ..errors import InvalidInput


def with_noise(data: Floats, snr: float, random: np.random.Generator, where: Flags) -> tuple[Floats, float]:
    """Add noise whose standard deviation is the root mean square of the data divided by ``snr``.

    Args:
        data: any shape and unit.
        snr: ratio of amplitudes, not in dB; the dissertation's hard case (section 7.3.1) is 10.
        random: generator of the noise.
        where: of the shape of ``data``: values that define the mean square and receive noise.

    Returns:
        The noisy copy and the noise's standard deviation, in the unit of the data.

    Raises:
        InvalidInput: for an snr that is not a finite number above 0.
    """
    if not 0.0 < snr < math.inf:
        raise InvalidInput("snr", snr, "a finite ratio > 0")
    sigma = math.sqrt(float(np.mean(data[where] ** 2))) / snr if where.any() else 0.0
    noise = random.normal(0.0, 1.0, data.shape)
    return np.where(where, data + sigma * noise, data), sigma


def robust_deviation(values: Floats) -> float:
    """Standard deviation of normally distributed values with outliers, from the median absolute deviation."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def root_mean_square(values: Floats) -> float:
    """Standard deviation of values around 0, outliers included."""
    return math.sqrt(float((values * values).mean()))


def noise_level(delta: Floats, deviation: Callable[[Floats], float] = root_mean_square) -> float:
    """Noise estimate from fourth differences of neighbouring pairs, unit of the data.

    Fourth differences along emitters, receivers and both diagonals remove what is smooth over five elements,
    the object, and keep the noise. The largest of the four directions is used, because
    noise may be correlated along one. With a coarse array part of the object remains.

    Args:
        delta: (..., ntx, nrx) around a ring, NaN where there is none.
        deviation: of the differences, around 0; by default wrong picks count.

    Returns:
        0 where no five neighbours have values.
    """
    levels = [0.0]
    for step in ((0, 1), (1, 0), (1, 1), (1, -1)):
        left = 6.0 * delta
        for away, weight in ((1, -4.0), (2, 1.0)):
            for side in (-away, away):
                left = left + weight * np.roll(delta, (side * step[0], side * step[1]), (-2, -1))
        left = left[np.isfinite(left)]
        if left.size:
            # 1² + 4² + 6² + 4² + 1²
            levels.append(deviation(left) / math.sqrt(70.0))
    return max(levels)

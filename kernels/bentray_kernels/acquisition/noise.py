"""Gaussian noise of a given signal-to-noise ratio on simulated data."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Flags, Floats
from ..errors import InvalidInput


def with_noise(data: Floats, snr: float, random: np.random.Generator, where: Flags) -> tuple[Floats, float]:
    """Add noise whose standard deviation is the root mean square of the data divided by ``snr``.

    Args:
        data: any shape and unit.
        snr: ratio of amplitudes, not in dB; the dissertation's hard case (section 7.3.1) is 10.
        random: where the noise comes from.
        where: of the shape of ``data``: values that count for the mean square and get noise.

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

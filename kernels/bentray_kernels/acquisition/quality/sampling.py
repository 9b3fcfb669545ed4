"""Checks of the sampling rate against the water speed, and of the centre frequency against the spectrum."""

from __future__ import annotations

import numpy as np

from ..dataset import Dataset
from .finding import Finding
from .water_line import WaterLine

# Largest accepted relative error of water speed, radius and clock together.
LARGEST_SPEED_ERROR = 0.02

# Largest accepted factor between stated and measured centre frequency: the windows of pickers depend on it.
LARGEST_FREQUENCY_FACTOR = 1.6

# Emissions averaged for the spectrum.
EMISSIONS = 8


def sampling(dataset: Dataset, line: WaterLine) -> list[Finding]:
    """Inconsistent sampling rate, geometry or water speed: the scan is rejected."""
    ratio = line.speed_mps / dataset.water_speed_mps
    if abs(ratio - 1.0) <= LARGEST_SPEED_ERROR:
        return []
    return [
        Finding(
            "sampling rate",
            f"arrivals in water at {line.speed_mps:.0f} m/s, {ratio:.3g} times the stated "
            f"{dataset.water_speed_mps:.0f} m/s: sampling rate, element positions or water speed are wrong",
            f"within {100 * LARGEST_SPEED_ERROR:g} %",
            "refused",
            value=ratio,
            unit="of the stated speed",
        )
    ]


def frequency(dataset: Dataset) -> list[Finding]:
    """A centre frequency that differs from the spectrum of the water traces."""
    assert dataset.waveform is not None
    assert dataset.sampling_rate_hz is not None
    traces = dataset.waveform.water if dataset.waveform.water is not None else dataset.waveform.object
    if dataset.center_frequency_hz is None:
        return []
    power = np.zeros(traces.shape[-1] // 2 + 1)
    for e in range(0, len(traces), max(1, len(traces) // EMISSIONS)):
        emission = np.asarray(traces[e], dtype=np.float64)
        emission = emission[np.isfinite(emission).all(axis=1)]
        if emission.size:
            spectrum = np.fft.rfft(emission - emission.mean(axis=1, keepdims=True), axis=1)
            power += (np.abs(spectrum) ** 2).sum(axis=0)
    if not power.any():
        return []
    of_power = np.fft.rfftfreq(traces.shape[-1], 1.0 / dataset.sampling_rate_hz)
    # The median is the level of white noise: most frequencies contain nothing else.
    power = np.maximum(power - np.median(power), 0.0)
    strong = power >= 0.1 * power.max()
    middle = float((of_power * power)[strong].sum() / power[strong].sum())
    factor = middle / dataset.center_frequency_hz
    if 1.0 / LARGEST_FREQUENCY_FACTOR <= factor <= LARGEST_FREQUENCY_FACTOR:
        return []
    return [
        Finding(
            "centre frequency",
            f"a spectrum about {middle:.4g} Hz, {dataset.center_frequency_hz:.4g} Hz stated",
            f"within a factor of {LARGEST_FREQUENCY_FACTOR:g}",
            "refused",
            value=factor,
            unit="of the stated frequency",
        )
    ]

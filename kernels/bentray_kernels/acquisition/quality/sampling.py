"""Checks of the sampling rate against the water speed, and of the centre frequency against the spectrum."""

from collections.abc import Iterator

import numpy as np

from ..dataset import Dataset
from ..pulse_spectrum import EMISSIONS, mean_frequency, power_of, without_noise
from .finding import Finding

# Largest accepted relative error of water speed, radius and clock together.
LARGEST_SPEED_ERROR = 0.02

# Standard deviations of the fitted speed that are accepted beyond it.
CERTAIN = 5.0

# Largest accepted factor between stated and measured centre frequency: the windows of pickers depend on it.
LARGEST_FREQUENCY_FACTOR = 1.6


def sampling(dataset: Dataset, speed_mps: float, sigma_mps: float = 0.0) -> Iterator[Finding]:
    """Inconsistent sampling rate, geometry or water speed: the scan is rejected.

    Args:
        dataset: of one slice.
        speed_mps: of the water, from the arrival times.
        sigma_mps: its standard deviation.
    """
    ratio = speed_mps / dataset.water_speed_mps
    uncertain = CERTAIN * sigma_mps / dataset.water_speed_mps
    if abs(ratio - 1.0) <= LARGEST_SPEED_ERROR + uncertain:
        return
    yield Finding(
        "sampling rate",
        f"arrivals in water at {speed_mps:.0f} m/s, {ratio:.3g} times the stated "
        f"{dataset.water_speed_mps:.0f} m/s: sampling rate, element positions or water speed are wrong",
        f"within {100 * LARGEST_SPEED_ERROR:g} %",
        "refused",
        value=ratio,
        unit="of the stated speed",
    )


def frequency(dataset: Dataset) -> Iterator[Finding]:
    """A centre frequency that differs from the spectrum of the water traces."""
    recorded = dataset.traces
    traces = recorded.object if recorded.water is None else recorded.water
    if dataset.center_frequency_hz is None:
        return
    power = np.zeros(traces.shape[-1] // 2 + 1)
    for e in range(0, len(traces), max(1, len(traces) // EMISSIONS)):
        emission = np.asarray(traces[e], dtype=np.float64)
        power += power_of(emission[np.isfinite(emission).all(axis=1)])
    if not power.any():
        return
    of_power = np.asarray(np.fft.rfftfreq(traces.shape[-1], 1.0 / dataset.rate_hz), dtype=np.float64)
    middle = mean_frequency(without_noise(power), of_power)
    factor = middle / dataset.center_frequency_hz
    if 1.0 / LARGEST_FREQUENCY_FACTOR <= factor <= LARGEST_FREQUENCY_FACTOR:
        return
    yield Finding(
        "centre frequency",
        f"a spectrum about {middle:.4g} Hz, {dataset.center_frequency_hz:.4g} Hz stated",
        f"within a factor of {LARGEST_FREQUENCY_FACTOR:g}",
        "refused",
        value=factor,
        unit="of the stated frequency",
    )

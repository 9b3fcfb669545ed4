"""Time zero of the recording, from the water line, and of the object scan, from unobstructed pairs."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..noise import robust_deviation
from ..reference import chord_offset
from .finding import Finding
from .water_line import WaterLine

RECORDING = "time zero of the recording"
OBJECT = "time zero of the object scan"

# Largest accepted delay of the water maximum, periods: the windows of pickers are a little wider.
LARGEST_DELAY = 3.0

# Pairs whose chord stays this fraction of the radius away from the centre are assumed to miss the object.
OUTSIDE = 0.88
MIN_PAIRS = 12

# Largest accepted median of their times, fraction of a period; without a frequency, s.
LARGEST_OFFSET = 0.1
LARGEST_OFFSET_S = 5e-8


def find_recording_shift(dataset: Dataset, line: WaterLine) -> list[Finding]:
    """Find a start of the recording that deviates by more than the delay of the pulse."""
    assert dataset.center_frequency_hz is not None
    if abs(line.intercept_s) <= LARGEST_DELAY / dataset.center_frequency_hz:
        return []
    return [
        Finding(
            RECORDING,
            f"water pulses differ from their straight time by {1e6 * line.intercept_s:.3g} µs",
            f"within {LARGEST_DELAY:g} periods",
            "corrected",
            value=line.intercept_s,
            unit="s",
        )
    ]


def find_time_shift(dataset: Dataset, delta: Floats) -> list[Finding]:
    """Find a trigger offset of the object scan, which shifts all times equally.

    Args:
        dataset: of one slice.
        delta: (ntx, nrx), s.
    """
    missing = delta[(chord_offset(dataset) >= OUTSIDE) & np.isfinite(delta)]
    if missing.size < MIN_PAIRS:
        return []
    offset = float(np.median(missing))
    scatter = robust_deviation(missing)
    frequency = dataset.center_frequency_hz
    largest = LARGEST_OFFSET_S if frequency is None else LARGEST_OFFSET / frequency
    if abs(offset) <= max(largest, scatter):
        return []
    return [
        Finding(
            OBJECT,
            f"pairs that miss the object differ from water by {1e9 * offset:.0f} ns ({missing.size} pairs)",
            f"within {1e9 * largest:.0f} ns",
            "corrected",
            value=offset,
            unit="s",
        )
    ]

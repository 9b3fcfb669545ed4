"""Time zero of the recording, from the water line, and of the object scan, from unobstructed pairs."""

from collections.abc import Iterator

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..noise import robust_deviation
from ..reference.water_chords import chord_offset
from .finding import Action, Finding
from .water_line import WaterLine

RECORDING = "time zero of the recording"
OBJECT = "time zero of the object scan"

# Largest accepted delay of the water maximum, periods: the windows of pickers are a little wider.
LARGEST_DELAY = 3.0

# Pairs whose chord stays this fraction of the radius away from the centre are assumed to miss the object.
OUTSIDE = 0.88
MIN_PAIRS = 12

# Largest time zero that is corrected: periods, or part of the longest flight in water if that is more.
MOST_PERIODS, MOST_FLIGHT = 10.0, 0.25

# A time zero beyond the first number of periods, or this part of the flight, is the same for all pairs: they
# scatter by less than the last part of it.
SMALL_PERIODS, SMALL_FLIGHT, MOST_SCATTER = 3.0, 0.05, 1.0 / 3.0

# Times of the nearer and the farther half of the pairs that differ by more than this part of their median
# grow with the distance, as a time zero does not.
GROWING = 0.5

# Largest accepted median of their times, fraction of a period; without a frequency, s.
LARGEST_OFFSET = 0.1
LARGEST_OFFSET_S = 5e-8


def find_recording_shift(dataset: Dataset, line: WaterLine) -> Iterator[Finding]:
    """Find a start of the recording that deviates by more than the delay of the pulse."""
    if abs(line.intercept_s) <= LARGEST_DELAY / dataset.frequency_hz:
        return
    residuals = line.residual_s[np.isfinite(line.residual_s)]
    action, more = _correctable(dataset, line.intercept_s, robust_deviation(residuals))
    yield Finding(
        RECORDING,
        f"water pulses differ from their straight time by {1e6 * line.intercept_s:.3g} µs{more}",
        f"within {LARGEST_DELAY:g} periods",
        action,
        value=line.intercept_s,
        unit="s",
    )


def find_time_shift(dataset: Dataset, delta: Floats) -> Iterator[Finding]:
    """Find a trigger offset of the object scan, which shifts all times equally.

    Args:
        dataset: of one slice.
        delta: (ntx, nrx), s.
    """
    outside = (chord_offset(dataset) >= OUTSIDE) & np.isfinite(delta)
    missing = delta[outside]
    if missing.size < MIN_PAIRS:
        return
    offset = float(np.median(missing))
    scatter = robust_deviation(missing)
    frequency = dataset.center_frequency_hz
    largest = LARGEST_OFFSET_S if frequency is None else LARGEST_OFFSET / frequency
    if abs(offset) <= max(largest, scatter):
        return
    action, more = _correctable(dataset, offset, scatter)
    distance = dataset.distance_m()[outside]
    farther = distance > np.median(distance)
    if farther.any() and not farther.all():
        near, far = (float(np.median(missing[half])) for half in (~farther, farther))
        if abs(far - near) > max(GROWING * abs(offset), scatter, largest):
            action, more = "reported", ", but grow with the distance: the object is there, or other water"
    yield Finding(
        OBJECT,
        f"pairs that miss the object differ from water by {1e9 * offset:.0f} ns ({missing.size} pairs){more}",
        f"within {1e9 * largest:.0f} ns",
        action,
        value=offset,
        unit="s",
    )


def _correctable(dataset: Dataset, offset_s: float, scatter_s: float) -> tuple[Action, str]:
    """Advice about an offset of the median of some pairs, and why it is not corrected.

    Args:
        dataset: of one slice.
        offset_s: the median, s.
        scatter_s: standard deviation of these pairs, s.
    """
    flight = float(dataset.distance_m().max()) / dataset.water_speed_mps
    period = 0.0 if dataset.center_frequency_hz is None else 1.0 / dataset.center_frequency_hz
    most = max(MOST_PERIODS * period, MOST_FLIGHT * flight)
    if abs(offset_s) > most:
        return "refused", (
            f", more than a wrong time zero can be ({1e6 * most:.3g} µs, {100 * MOST_FLIGHT:.0f} % of the "
            "flight through the array): check positions, their order, water speed and t0_s"
        )
    small = max(SMALL_PERIODS * period, SMALL_FLIGHT * flight)
    if abs(offset_s) > small and scatter_s > MOST_SCATTER * abs(offset_s):
        return "reported", (
            f", but scatter by {1e9 * scatter_s:.0f} ns: no time zero, which would be the same for all"
        )
    return "corrected", ""

"""Differential picking of one emission: arrival in the object minus arrival in water at every receiver."""

import math

import numpy as np

from ...compilation.compiled import kernel
from .cross_correlation import delay_deviation, find_delay, match_pulse, noise_fraction
from .onset import Trace, prepare
from .pickers import CORRELATION, onset

# Range of apparent speeds of first arrivals, m/s: slower than fat, faster than skin.
SLOWEST_MPS = 1300.0
FASTEST_MPS = 1700.0

# Largest distance of the water pulse from the straight water time, periods: the length of the pulse, with the
# reference time anywhere in it, and numerical dispersion of simulated ones.
WATER_REACH = 4.0

# Segment of the water pulse that is correlated with the object trace, periods before and after its onset. It
# ends with the first cycles: the coda belongs to other paths.
PULSE_BEFORE = 0.5
PULSE_AFTER = 1.5

# Largest shift of the onset by correlation, periods; the next cycle lies beyond.
MATCH_REACH = 0.5

# Lowest accepted correlation of the pulses in object and water.
MIN_CORRELATION = 0.8

# Most independent noise values per period, because of the bandwidth of the transducers.
INDEPENDENT = 4.0

# Smallest standard deviation of a delay, samples.
FINEST = 0.02

# Receivers nearer than this to the emitter, wavelengths, record its ringing and no path through the object.
NEAREST = 2.0


@kernel
def emission(
    object_: Trace,
    water: Trace,
    distance: Trace,
    water_speed: float,
    rate: float,
    start: float,
    frequency: float,
    rounding: float,
    picker: int,
    delta: Trace,
    sigma: Trace,
) -> None:
    """Fill ``delta`` and ``sigma``, s, for every receiver of one emitter; NaN where nothing was found.

    Args:
        object_, water: (nrx, nt) traces.
        distance: (nrx,), m.
        water_speed: m/s.
        rate, start: sampling rate, Hz, and time of the first sample, s.
        frequency: centre frequency of the pulse, Hz.
        rounding: standard deviation of the traces' rounding, in their unit.
        picker: code of a ``picking.pickers.Picker``.
        delta, sigma: (nrx,), s, written.
    """
    nt = water.shape[1]
    period = rate / frequency
    w = np.empty(nt)
    o = np.empty(nt)
    for r in range(distance.size):
        delta[r] = np.nan
        sigma[r] = np.nan
        far = distance[r]
        if not far >= NEAREST * water_speed / frequency:
            continue
        straight = (far / water_speed - start) * rate
        begin, end = clip(straight - WATER_REACH * period, straight + WATER_REACH * period, nt)
        water_noise = prepare(water[r], begin, rounding, w)
        if end - begin < 2.0 * period or not math.isfinite(water_noise):
            continue
        water_onset, strong = onset(w, begin, end, period, water_noise, picker)
        if not math.isfinite(water_onset):
            continue
        # Search window in the object: around the water pulse, shifted by plausible speeds.
        early = (far / FASTEST_MPS - far / water_speed) * rate
        late = (far / SLOWEST_MPS - far / water_speed) * rate
        begin, end = clip(water_onset + early - period, strong + late + 0.5 * period, nt)
        noise = prepare(object_[r], begin, rounding, o)
        if end - begin < 2.0 * period or not math.isfinite(noise):
            continue
        pulse, past = clip(water_onset - PULSE_BEFORE * period, water_onset + PULSE_AFTER * period, nt)
        object_onset, _ = onset(o, begin, end, period, noise, picker)
        moved = object_onset - water_onset
        if picker == CORRELATION:
            moved = find_delay(w, o, pulse, past, early, late, noise)
        if not math.isfinite(object_onset) or not math.isfinite(moved):
            continue
        shift, same = match_pulse(w, o, pulse, past, moved, MATCH_REACH * period)
        if math.isfinite(shift) and same >= MIN_CORRELATION:
            delta[r] = shift / rate
            quiet = noise_fraction(w, pulse, past, water_noise)
            moved_by = min(max(math.floor(shift + 0.5), -pulse), nt - past)
            noisy = quiet + noise_fraction(o, pulse + moved_by, past + moved_by, noise)
            count = max(1, math.floor(INDEPENDENT * (past - pulse) / period))
            sigma[r] = (
                math.hypot(delay_deviation(same, period, noisy, min(count, past - pulse)), FINEST) / rate
            )


@kernel(inline="always")
def clip(begin: float, end: float, nt: int) -> tuple[int, int]:
    """The samples of a window inside the trace, as (first, one past the last)."""
    return min(max(math.floor(begin), 0), nt), min(max(math.ceil(end) + 1, 0), nt)

"""Arrival times of the water pulses to a fraction of a sample, by correlation with the common pulse."""

import math

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..picking.cross_correlation import match_pulse
from ..picking.first_arrivals import require_traces
from ..picking.pulse import BEFORE, measured_pulse
from ..quality.measures import Measures

# Largest distance of the match from the maximum of the envelope, periods; the next cycle lies beyond.
REACH = 0.5

MIN_CORRELATION = 0.8

# Pairs nearer than this fraction of the longest one are dominated by cross-talk.
NEAREST = 0.15


def water_times(dataset: Dataset) -> Floats:
    """Arrival time of the pulse of the water shot, (ntx, nrx), s; NaN where there is none.

    All times contain the same delay of the pulse. They do not depend on the nominal element positions.

    Args:
        dataset: of one slice, with correct channels and polarity; see ``quality``. Its traces may
            be ``Emissions``.

    Raises:
        InvalidInput: without water traces, sampling rate, centre frequency, or a pulse.
    """
    require_traces(dataset)
    rate, water = dataset.rate_hz, dataset.traces.water_traces
    crest = Measures.from_traces(water, dataset).strongest_s
    pulse = measured_pulse(dataset, crest)
    period = rate / dataset.frequency_hz
    ahead = math.ceil(BEFORE * period)
    begin, end = max(0, ahead - math.ceil(1.5 * period)), min(pulse.size, ahead + math.ceil(1.5 * period))
    times = np.full(crest.shape, np.nan)
    distance = dataset.distance_m()
    valid = np.isfinite(crest) & (distance >= NEAREST * distance.max())
    if dataset.valid is not None:
        valid &= dataset.valid
    for e in np.flatnonzero(valid.any(axis=1)):
        emission = water[e]
        for r in np.flatnonzero(valid[e]):
            trace = np.asarray(emission[r], dtype=np.float64)
            trace = trace - np.median(trace)
            shift = (crest[e, r] - dataset.t0_s) * rate - ahead
            lag, correlation = match_pulse(pulse, trace, begin, end, shift, REACH * period)
            if math.isfinite(lag) and correlation >= MIN_CORRELATION:
                times[e, r] = dataset.t0_s + (ahead + lag) / rate
    return times

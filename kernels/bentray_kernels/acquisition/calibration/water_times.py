"""Times of the water pulses, to a small part of a sample: the common pulse matched with every trace."""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..picking.cross_correlation import match
from ..picking.first_arrivals import require_traces
from ..picking.pulse import BEFORE, measured_pulse
from ..quality.measures import Measures

# How far from the envelope's crest the best match may lie, periods; further on lies the next swing.
REACH = 0.5

LEAST_LIKENESS = 0.8

# Pairs nearer than this part of the longest one hear more of the electronics than of the water.
NEAREST = 0.15


def water_times(dataset: Dataset) -> Floats:
    """When the pulse of the water shot arrives, (ntx, nrx), s; NaN where there is none.

    All times are late by the same: the pulse's own delay. They do not depend on where the elements are said
    to be.

    Args:
        dataset: of one slice, channels in their places and the right way up; see ``quality``. Its traces may
            be ``Emissions``.

    Raises:
        InvalidInput: without water traces, sampling rate, centre frequency, or a pulse.
    """
    require_traces(dataset)
    assert dataset.waveform is not None
    assert dataset.waveform.water is not None
    assert dataset.sampling_rate_hz is not None
    assert dataset.center_frequency_hz is not None
    rate = dataset.sampling_rate_hz
    crest = Measures.of(dataset.waveform.water, dataset).strongest_s
    pulse = measured_pulse(dataset, crest)
    period = rate / dataset.center_frequency_hz
    ahead = math.ceil(BEFORE * period)
    begin, end = max(0, ahead - math.ceil(1.5 * period)), min(pulse.size, ahead + math.ceil(1.5 * period))
    times = np.full(crest.shape, np.nan)
    distance = dataset.distance_m()
    wanted = np.isfinite(crest) & (distance >= NEAREST * distance.max())
    if dataset.valid is not None:
        wanted &= dataset.valid
    for e in np.flatnonzero(wanted.any(axis=1)):
        emission = dataset.waveform.water[e]
        for r in np.flatnonzero(wanted[e]):
            trace = np.asarray(emission[r], dtype=np.float64)
            trace = trace - np.median(trace)
            shift = (crest[e, r] - dataset.t0_s) * rate - ahead
            lag, likeness = match(pulse, trace, begin, end, shift, REACH * period)
            if math.isfinite(lag) and likeness >= LEAST_LIKENESS:
                times[e, r] = dataset.t0_s + (ahead + lag) / rate
    return times

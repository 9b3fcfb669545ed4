"""Recorded pulses of chords through water, cut out of the traces of an object scan."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Floats, Ints
from ..dataset import Dataset
from ..noise import robust_deviation
from ..picking.onset import LEAD
from .water_chords import WaterChords

# Extent of a pulse about the maximum of its envelope, periods.
BEFORE, AFTER = 3.0, 4.0

# Most chords that are kept, over all emissions, and of each emission; least of each emission.
MAX_CHORDS, MAX_PER_EMISSION, MIN_PER_EMISSION = 16384, 64, 8


class ChordPulses(NamedTuple):
    """Recorded pulses of chords through water.

    Attributes:
        emission, reception: (chords,), indices of the pair.
        begin: (chords,), index of the first sample in the trace.
        samples: (chords, length), in counts, or in the unit of ``Waveform.object_scale``.
        noise: (chords,), standard deviation of the trace before its arrival, NaN if that is too short.
    """

    emission: Ints
    reception: Ints
    begin: Ints
    samples: NDArray[np.float32]
    noise: Floats

    @classmethod
    def joined(cls, pulses: Sequence[ChordPulses]) -> ChordPulses:
        """Concatenate the pulses of parts of the emissions."""
        return cls(*(np.concatenate(column) for column in zip(*pulses, strict=True)))

    def inverted(self, pairs: Flags) -> ChordPulses:
        """The pulses with the opposite sign for some pairs, (ntx, nrx)."""
        sign = np.where(pairs[self.emission, self.reception], -1.0, 1.0).astype(np.float32)
        return self._replace(samples=self.samples * sign[:, None])


def chords_of_emission(emissions: int) -> int:
    """Most chords of each emission that are kept."""
    return min(MAX_PER_EMISSION, max(MIN_PER_EMISSION, MAX_CHORDS // emissions))


def read_pulses(dataset: Dataset, emissions: Iterable[int], chords: WaterChords) -> ChordPulses:
    """Cut the pulses of chords through water out of the traces of some emissions.

    Args:
        dataset: of one slice with traces of the object, which may be ``Emissions``, and a centre frequency.
        emissions: indices, from 0.
        chords: see ``find_water_chords``.
    """
    traces = dataset.traces
    before, length = window(dataset.rate_hz * (1.0 / dataset.frequency_hz))
    late = chords.arrival_s(dataset.distance_m())
    if chords.emission_delay_s is not None and chords.reception_delay_s is not None:
        late = late + chords.emission_delay_s[:, None] + chords.reception_delay_s
    arrival = (late - dataset.t0_s) * dataset.rate_hz
    begin = np.floor(arrival).astype(np.int64) - before
    most = chords_of_emission(len(dataset.tx))
    whole = chords.pairs & (begin >= 0) & (begin + length <= traces.object.shape[-1])
    pairs: list[tuple[int, int, int]] = []
    samples: list[NDArray[np.float32]] = []
    noise: list[float] = []
    for e in emissions:
        receivers = np.flatnonzero(whole[e])
        if not receivers.size:
            continue
        receivers = receivers[np.unique(np.linspace(0, receivers.size - 1, most).astype(np.int64))]
        emission = np.asarray(traces.object[e])
        for r in receivers.tolist():
            trace = emission[r].astype(np.float32)
            trace -= np.median(trace)
            if traces.object_scale is not None:
                trace *= np.float32(traces.object_scale[e, r])
            pairs.append((e, r, int(begin[e, r])))
            samples.append(trace[begin[e, r] : begin[e, r] + length])
            before_it = trace[: begin[e, r]]
            noise.append(robust_deviation(before_it) if len(before_it) >= LEAD else np.nan)
    index = np.array(pairs, dtype=np.int64).reshape(-1, 3)
    pulses = np.array(samples, dtype=np.float32).reshape(-1, length)
    return ChordPulses(index[:, 0], index[:, 1], index[:, 2], pulses, np.array(noise))


def window(period: float) -> tuple[int, int]:
    """Samples before the arrival, and all samples, of a pulse with a period in samples."""
    before = math.ceil(BEFORE * period)
    return before, before + math.ceil(AFTER * period)

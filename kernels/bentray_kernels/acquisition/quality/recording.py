"""Checks of the traces of a slice before picking: faults of traces, channels and clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ..dataset import Dataset
from .broken import find_broken, find_clipped
from .correction import apply, exchange_order
from .dead import find_dead
from .drift import DRIFT, find_drift
from .elements import CLOCK, DISPLACED, find_element_errors
from .finding import Finding, left_out
from .measures import Measures
from .order import ORDER, find_wrong_order
from .polarity import find_inverted, water_signs
from .positions import find_displaced
from .sampling import frequency, sampling
from .shadow import SCATTERER, find_scatterer
from .swapped import find_swapped
from .time_zero import find_recording_shift
from .water_line import WaterLine
from .water_speed import WATER_SPEED, find_water_speed

OF_TRACES = ("values", "constant traces", "clipping", "dead elements")
OF_WATER = (
    ORDER,
    "sampling rate",
    WATER_SPEED,
    "centre frequency",
    "time zero of the recording",
    "swapped channels",
    "polarity",
    "element positions",
    CLOCK,
    DISPLACED,
    DRIFT,
    SCATTERER,
)

# Standard deviation of the water speed from maxima of envelopes, as a part of it: dispersion moves them.
ENVELOPE = 0.002


class Measured(NamedTuple):
    """Measures of the traces of some emissions; None for a missing scan."""

    water: Measures | None
    object: Measures

    @classmethod
    def from_dataset(
        cls, dataset: Dataset, emissions: Sequence[int], done: Callable[[], None] = lambda: None
    ) -> Measured:
        """Measure a slice with traces, which may be ``Emissions``; ``done`` is called after each emission."""

        def read(traces: Any) -> Iterator[NDArray[Any]]:
            for e in emissions:
                yield traces[e]
                done()

        received, water = (
            None if traces is None else Measures.from_traces(read(traces), dataset)
            for traces in (dataset.traces.object, dataset.traces.water)
        )
        assert received is not None
        return cls(water, received)

    @classmethod
    def joined(cls, measured: Sequence[Measured]) -> Measured:
        """Concatenate the measures of parts of the emissions."""
        water = [slice_measured.water for slice_measured in measured if slice_measured.water is not None]
        return cls(Measures.joined(water) if water else None, Measures.joined([p.object for p in measured]))


def check_traces(dataset: Dataset, measured: Measured) -> tuple[list[Finding], tuple[str, ...]]:
    """Findings of the traces, in the order in which they are applied, and the names of the checks made.

    Args:
        dataset: of one slice with traces, which may be ``Emissions``.
        measured: of all its emissions.
    """
    findings, strongest = _of_traces(dataset, measured)
    checked: tuple[str, ...] = OF_TRACES
    if strongest is not None:
        assert measured.water is not None
        findings += _of_water(apply(dataset, findings), strongest)
        if dataset.center_frequency_hz is not None:
            findings += find_scatterer(dataset, _log_ratio(measured.object, measured.water))
        checked += OF_WATER
    if not dataset.picked and dataset.center_frequency_hz is None:
        # The traces cannot be picked.
        findings.append(Finding("centre frequency", "none", "the centre frequency of the pulse", "refused"))
    return findings, checked


def _of_traces(dataset: Dataset, measured: Measured) -> tuple[list[Finding], Floats | None]:
    """Faults of single traces in both scans, and the times of the water maxima."""
    findings: list[Finding] = []
    for which, measures in (("water", measured.water), ("object", measured.object)):
        if measures is None:
            continue
        if which == "water" or measured.water is None:
            findings += find_dead(dataset, measures.detected)
        out = left_out(findings, measures.detected.shape)
        findings += find_broken(dataset, measures, which, out)
        findings += find_clipped(dataset, measures, which)
    if measured.water is None:
        return findings, None
    valid, strongest = apply(dataset, findings).valid, measured.water.unclipped_s
    return findings, strongest if valid is None else np.where(valid, strongest, np.nan)


def _of_water(dataset: Dataset, strongest: Floats) -> list[Finding]:
    """Faults of the water shot with respect to the geometry."""
    if mismatch := find_wrong_order(dataset, strongest):
        return mismatch
    line = WaterLine.from_dataset(dataset, strongest)
    if line is None:
        return [Finding("water shot", "almost no pulses", "pulses that crossed the water", "refused")]
    speed = find_water_speed(dataset, line.speed_mps, ENVELOPE * line.speed_mps)
    dataset = apply(dataset, speed)
    refused = [*sampling(dataset, line.speed_mps), *frequency(dataset)]
    if refused or dataset.center_frequency_hz is None:
        return refused
    line = WaterLine.from_dataset(dataset, strongest)
    assert line is not None
    straight = dataset.distance_m() / dataset.water_speed_mps + line.intercept_s
    exchanged = list(find_swapped(dataset, strongest, straight))
    for finding in exchanged:
        # The maxima after the exchange of channels.
        order, axis = exchange_order(dataset, finding)
        strongest = np.take(strongest, order, axis=axis)
    right = apply(dataset, exchanged)
    inverted = find_inverted(right, water_signs(right, strongest))
    return [
        *speed,
        *exchanged,
        *inverted,
        *find_recording_shift(dataset, line),
        *find_displaced(dataset, strongest, line),
        *find_element_errors(dataset, line.departures(dataset, strongest)),
        *find_drift(dataset, line.departures(dataset, strongest)),
    ]


def _log_ratio(received: Measures, water: Measures) -> Floats:
    """Logarithm of the object's amplitude over that of the water, (ntx, nrx); NaN where one has no pulse."""
    # A pulse that the object has removed is as weak as what was found.
    usable = water.detected & np.isfinite(received.peak) & (received.peak > 0.0)
    ratio = np.where(usable, received.peak, 1.0) / np.where(usable, water.peak, 1.0)
    return np.where(usable, np.log(ratio), np.nan)

"""Checks of the traces of a slice before picking: faults of traces, channels and clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Floats
from ..dataset import Dataset
from .broken import find_broken, find_clipped
from .correction import apply, exchange_order
from .dead import find_dead
from .finding import Finding
from .measures import Measures
from .polarity import find_inverted
from .positions import find_displaced
from .sampling import frequency, sampling
from .swapped import find_swapped
from .time_zero import find_recording_shift
from .water_line import WaterLine

OF_TRACES = ("values", "constant traces", "clipping", "dead elements")
OF_WATER = (
    "sampling rate",
    "centre frequency",
    "time zero of the recording",
    "swapped channels",
    "polarity",
    "element positions",
)


class Measured(NamedTuple):
    """Measures of the traces of some emissions; None for a missing scan."""

    water: Measures | None
    object: Measures

    @classmethod
    def of(
        cls, dataset: Dataset, emissions: Sequence[int], done: Callable[[], None] = lambda: None
    ) -> Measured:
        """Measure a slice with traces, which may be ``Emissions``; ``done`` is called after each emission."""
        assert dataset.waveform is not None

        def read(traces: Any) -> Iterator[NDArray[Any]]:
            for e in emissions:
                yield traces[e]
                done()

        received, water = (
            None if traces is None else Measures.of(read(traces), dataset)
            for traces in (dataset.waveform.object, dataset.waveform.water)
        )
        assert received is not None
        return cls(water, received)

    @classmethod
    def joined(cls, parts: Sequence[Measured]) -> Measured:
        """Concatenate the measures of parts of the emissions."""
        water = [part.water for part in parts if part.water is not None]
        return cls(Measures.joined(water) if water else None, Measures.joined([p.object for p in parts]))


def check_traces(dataset: Dataset, measured: Measured) -> tuple[list[Finding], tuple[str, ...]]:
    """Findings of the traces, in the order in which they are applied, and the names of the checks made.

    Args:
        dataset: of one slice with traces, which may be ``Emissions``.
        measured: of all its emissions.
    """
    findings, strongest = _of_traces(dataset, measured)
    checked: tuple[str, ...] = OF_TRACES
    if strongest is not None:
        findings += _of_water(apply(dataset, findings), strongest)
        checked += OF_WATER
    if not dataset.picked and (missing := _unpickable(dataset)):
        findings.append(missing)
    return findings, checked


def _unpickable(dataset: Dataset) -> Finding | None:
    """A finding if the traces cannot be picked."""
    if dataset.center_frequency_hz is None:
        return Finding("centre frequency", "none", "the centre frequency of the pulse", "refused")
    return None


def _of_traces(dataset: Dataset, measured: Measured) -> tuple[list[Finding], Floats | None]:
    """Faults of single traces in both scans, and the times of the water maxima."""
    findings: list[Finding] = []
    for which, measures in (("water", measured.water), ("object", measured.object)):
        if measures is None:
            continue
        if which == "water" or measured.water is None:
            findings += find_dead(dataset, measures.detected)
        left_out = _left_out(findings, measures.detected)
        findings += find_broken(dataset, measures, which, left_out)
        findings += find_clipped(dataset, measures, which)
    if measured.water is None:
        return findings, None
    valid, strongest = apply(dataset, findings).valid, _unclipped_maxima(measured.water)
    return findings, strongest if valid is None else np.where(valid, strongest, np.nan)


def _unclipped_maxima(water: Measures) -> Floats:
    """Times of the maxima, (ntx, nrx), s; where most pulses are complete, without clipped ones.

    Clipped maxima are off by a fraction of a period, and strong near pairs are clipped: the fit of the line
    would be biased.
    """
    unclipped = np.where(water.clipped, np.nan, water.strongest_s)
    most = 2 * np.isfinite(unclipped).sum() >= np.isfinite(water.strongest_s).sum()
    return unclipped if most else water.strongest_s


def _of_water(dataset: Dataset, strongest: Floats) -> list[Finding]:
    """Faults of the water shot with respect to the geometry."""
    line = WaterLine.of(dataset, strongest)
    if line is None:
        return [Finding("water shot", "almost no pulses", "pulses that crossed the water", "refused")]
    findings = sampling(dataset, line) + frequency(dataset)
    if findings or dataset.center_frequency_hz is None:
        return findings
    exchanged = find_swapped(dataset, strongest, line)
    for finding in exchanged:
        # The maxima after the exchange of channels.
        order, axis = exchange_order(dataset, finding)
        strongest = np.take(strongest, order, axis=axis)
    inverted = find_inverted(apply(dataset, exchanged), strongest)
    return (
        exchanged + inverted + find_recording_shift(dataset, line) + find_displaced(dataset, strongest, line)
    )


def _left_out(findings: list[Finding], like: Flags) -> Flags:
    pairs = np.zeros_like(like)
    for finding in findings:
        if finding.action == "left out" and finding.pairs is not None:
            pairs |= finding.pairs
    return pairs

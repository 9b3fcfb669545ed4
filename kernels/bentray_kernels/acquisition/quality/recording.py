"""What the traces of a slice show before times are read from them: faults of traces, channels and clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Floats
from ..dataset import Dataset
from .broken import broken, clipped
from .correction import apply, exchange
from .dead import dead
from .finding import Finding
from .measures import Measures
from .polarity import polarity
from .positions import positions
from .sampling import frequency, sampling
from .swapped import swapped
from .time_zero import recording
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
    """Figures of the traces of some emissions; None of a scan that is not there."""

    water: Measures | None
    object: Measures

    @classmethod
    def of(
        cls, dataset: Dataset, emissions: Sequence[int], done: Callable[[], None] = lambda: None
    ) -> Measured:
        """Of one slice with traces, which may be ``Emissions``; ``done`` is called after each of a scan."""
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
        """Of all emissions, from those of some each."""
        water = [part.water for part in parts if part.water is not None]
        return cls(Measures.joined(water) if water else None, Measures.joined([p.object for p in parts]))


def judged(dataset: Dataset, measured: Measured) -> tuple[list[Finding], tuple[str, ...]]:
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
    """Why no times can be read from the traces, if so."""
    assert dataset.waveform is not None
    if dataset.waveform.water is None:
        return Finding("water shot", "none", "the same scan without the object, or travel times", "refused")
    if dataset.center_frequency_hz is None:
        return Finding("centre frequency", "none", "the centre frequency of the pulse", "refused")
    return None


def _of_traces(dataset: Dataset, measured: Measured) -> tuple[list[Finding], Floats | None]:
    """Faults that a trace shows by itself, in both scans, and the times of the water's crests."""
    findings: list[Finding] = []
    for which, measures in (("water", measured.water), ("object", measured.object)):
        if measures is None:
            continue
        if which == "water" or measured.water is None:
            findings += dead(dataset, measures.heard)
        left_out = _left_out(findings, measures.heard)
        findings += broken(dataset, measures, which, left_out)
        findings += clipped(dataset, measures, which)
    if measured.water is None:
        return findings, None
    valid, strongest = apply(dataset, findings).valid, _whole_crests(measured.water)
    return findings, strongest if valid is None else np.where(valid, strongest, np.nan)


def _whole_crests(water: Measures) -> Floats:
    """Times of the crests, (ntx, nrx), s: where most pulses are whole, without those that were cut off.

    A cut crest is off by a part of a period, and near pairs are cut, for they are loud: the line would lean.
    """
    whole = np.where(water.clipped, np.nan, water.strongest_s)
    most = 2 * np.isfinite(whole).sum() >= np.isfinite(water.strongest_s).sum()
    return whole if most else water.strongest_s


def _of_water(dataset: Dataset, strongest: Floats) -> list[Finding]:
    """Faults that the water shot shows against the geometry."""
    line = WaterLine.of(dataset, strongest)
    if line is None:
        return [Finding("water shot", "hardly a pulse in it", "pulses that crossed the water", "refused")]
    findings = sampling(dataset, line) + frequency(dataset)
    if findings or dataset.center_frequency_hz is None:
        return findings
    exchanged = swapped(dataset, strongest, line)
    for finding in exchanged:
        # The crests of the channels in their places.
        order, axis = exchange(dataset, finding)
        strongest = np.take(strongest, order, axis=axis)
    inverted = polarity(apply(dataset, exchanged), strongest)
    return exchanged + inverted + recording(dataset, line) + positions(dataset, strongest, line)


def _left_out(findings: list[Finding], like: Flags) -> Flags:
    pairs = np.zeros_like(like)
    for finding in findings:
        if finding.action == "left out" and finding.pairs is not None:
            pairs |= finding.pairs
    return pairs

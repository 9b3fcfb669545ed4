"""All checks of a scan in their order: traces first, then channels, then the times picked from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Flags, Floats
from ..dataset import Dataset
from ..picking import pick
from .broken import broken, clipped
from .contradictions import contradictions
from .correction import apply, stacked
from .dead import dead
from .finding import Finding, Report
from .measures import Measures
from .polarity import polarity
from .sampling import frequency, sampling
from .swapped import swapped
from .time_zero import object_scan, recording
from .water_line import WaterLine

OF_TRACES = ("values", "constant traces", "clipping", "dead elements")
OF_WATER = (
    "sampling rate",
    "centre frequency",
    "time zero of the recording",
    "swapped channels",
    "polarity",
)
OF_TIMES = ("time zero of the object scan", "cycle jumps", "outliers", "reciprocity")


@dataclass(frozen=True)
class Examined:
    """A scan with its report.

    Attributes:
        report: what was found.
        picked: what goes on, with travel times; None for a refused scan.
    """

    report: Report
    picked: Dataset | None


def examine(
    dataset: Dataset, picker: str = "aic", progress: Callable[[int, int], None] | None = None
) -> Examined:
    """Check a scan, correct what can be corrected, pick its times where it has none, and check those.

    Every check looks at the data as the ones before it have left them.

    Args:
        dataset: with traces or travel times.
        picker: what reads times that are not there.
        progress: called with (slices done, slices in all).

    Raises:
        InvalidInput: for an unknown picker.
    """
    findings: list[Finding] = []
    parts: list[Dataset | None] = []
    checked: tuple[str, ...] = ()
    for k in range(dataset.slices):
        of_slice, part, checked = _slice(dataset.slice(k), picker)
        findings += [replace(finding, slice=k) for finding in of_slice]
        parts.append(part)
        if progress is not None:
            progress(k + 1, dataset.slices)
    whole = [part for part in parts if part is not None]
    picked = None
    if len(whole) == len(parts):
        # One slice keeps its truth and place; several lost them when they were cut.
        shown = whole[0] if dataset.slice_z_m is None else stacked(dataset, whole)
        picked = replace(shown, truth=dataset.truth, waveform=None)
    other = (dataset.tx[:, None] != dataset.rx[None, :]).sum() * dataset.slices
    usable = 0 if picked is None else int(np.isfinite(picked.differential_tof()).sum())
    name = "" if dataset.picked else picker
    return Examined(Report(tuple(findings), checked, int(other), usable, name), picked)


def _slice(dataset: Dataset, picker: str) -> tuple[list[Finding], Dataset | None, tuple[str, ...]]:
    """Findings of one slice, what goes on of it, and the checks that were made."""
    findings: list[Finding] = []
    checked: tuple[str, ...] = ()
    if dataset.waveform is not None:
        findings, dataset, strongest = _of_traces(dataset)
        checked += OF_TRACES
        if strongest is not None:
            of_water, dataset = _of_water(dataset, strongest)
            findings, checked = findings + of_water, checked + OF_WATER
    if not dataset.picked:
        missing = _unpickable(dataset)
        if missing:
            findings.append(missing)
        if any(finding.action == "refused" for finding in findings):
            return findings, None, checked
        dataset = pick(dataset, picker, screened=False)
    elif any(finding.action == "refused" for finding in findings):
        return findings, None, checked
    of_times, dataset = _of_times(dataset)
    if not np.isfinite(dataset.differential_tof()).any():
        of_times.append(
            Finding("travel times", "not one that can be used", "travel times of some pairs", "refused")
        )
        return findings + of_times, None, checked + OF_TIMES
    return findings + of_times, dataset, checked + OF_TIMES


def _unpickable(dataset: Dataset) -> Finding | None:
    """Why no times can be read from the traces, if so."""
    assert dataset.waveform is not None
    if dataset.waveform.water is None:
        return Finding("water shot", "none", "the same scan without the object, or travel times", "refused")
    if dataset.center_frequency_hz is None:
        return Finding("centre frequency", "none", "the centre frequency of the pulse", "refused")
    return None


def _of_traces(dataset: Dataset) -> tuple[list[Finding], Dataset, Floats | None]:
    """Faults that a trace shows by itself, in both scans, and the times of the water's crests."""
    assert dataset.waveform is not None
    findings: list[Finding] = []
    strongest = None
    for which, traces in (("water", dataset.waveform.water), ("object", dataset.waveform.object)):
        if traces is None:
            continue
        measures = Measures.of(traces, dataset)
        strongest = measures.strongest_s if which == "water" else strongest
        if which == "water" or dataset.waveform.water is None:
            findings += dead(dataset, measures.heard)
        left_out = _left_out(findings, measures.heard)
        findings += broken(dataset, measures, which, left_out)
        findings += clipped(dataset, measures, which)
    dataset = apply(dataset, findings)
    return findings, dataset, None if strongest is None else _masked(dataset, strongest)


def _crests(dataset: Dataset) -> Floats:
    """(ntx, nrx), s: crests of the water's pulses; NaN where a pair is left out."""
    assert dataset.waveform is not None
    assert dataset.waveform.water is not None
    return _masked(dataset, Measures.of(dataset.waveform.water, dataset).strongest_s)


def _masked(dataset: Dataset, times: Floats) -> Floats:
    return times if dataset.valid is None else np.where(dataset.valid, times, np.nan)


def _of_water(dataset: Dataset, strongest: Floats) -> tuple[list[Finding], Dataset]:
    """Faults that the water shot shows against the geometry."""
    line = WaterLine.of(dataset, strongest)
    if line is None:
        return [
            Finding("water shot", "hardly a pulse in it", "pulses that crossed the water", "refused")
        ], dataset
    findings = sampling(dataset, line) + frequency(dataset)
    if findings or dataset.center_frequency_hz is None:
        return findings, dataset
    exchanged = swapped(dataset, strongest, line)
    dataset = apply(dataset, exchanged)
    if exchanged:
        # Of the channels in their places.
        strongest = _crests(dataset)
    inverted = polarity(dataset, strongest)
    started = recording(dataset, line)
    return exchanged + inverted + started, apply(dataset, inverted + started)


def _of_times(dataset: Dataset) -> tuple[list[Finding], Dataset]:
    """Faults of the travel times."""
    delta = dataset.differential_tof()
    findings: list[Finding] = []
    if dataset.waveform is None and dataset.valid is None:
        findings += dead(dataset, _heard(dataset, delta))
    findings += object_scan(dataset, delta)
    dataset = apply(dataset, findings)
    findings += (later := contradictions(dataset, dataset.differential_tof()))
    return findings, apply(dataset, later)


def _heard(dataset: Dataset, delta: Floats) -> Flags:
    """(ntx, nrx): pairs with a time; one way is enough."""
    known = np.isfinite(delta)
    elements = len(dataset.element_position_m)
    full = np.zeros((elements, elements), dtype=bool)
    full[np.ix_(dataset.tx, dataset.rx)] = known
    return np.asarray((full | full.T)[np.ix_(dataset.tx, dataset.rx)])


def _left_out(findings: list[Finding], like: Flags) -> Flags:
    pairs = np.zeros_like(like)
    for finding in findings:
        if finding.action == "left out" and finding.pairs is not None:
            pairs |= finding.pairs
    return pairs

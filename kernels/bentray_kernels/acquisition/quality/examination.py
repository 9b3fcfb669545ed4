"""All checks of a scan in their order: traces first, then channels, then the times picked from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Flags, Floats
from ..dataset import Dataset
from ..picking import pick
from .contradictions import contradictions
from .correction import apply, stacked
from .dead import dead
from .finding import Finding, Report
from .recording import Measured, judged
from .time_zero import object_scan

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
        findings, checked = judged(dataset, Measured.of(dataset, range(len(dataset.tx))))
    if any(finding.action == "refused" for finding in findings):
        return findings, None, checked
    dataset = apply(dataset, findings)
    if not dataset.picked:
        dataset = pick(dataset, picker, screened=False)
    of_times = times_judged(dataset)
    findings += of_times
    if any(finding.action == "refused" for finding in of_times):
        return findings, None, checked + OF_TIMES
    return findings, apply(replace(dataset, waveform=None), of_times), checked + OF_TIMES


def times_judged(dataset: Dataset) -> list[Finding]:
    """Findings of the travel times of one slice, in the order in which they are applied."""
    findings: list[Finding] = []
    if dataset.waveform is None and dataset.valid is None:
        findings += dead(dataset, _heard(dataset, dataset.differential_tof()))
    findings += object_scan(dataset, dataset.differential_tof())
    left = apply(replace(dataset, waveform=None), findings)
    later = contradictions(left, left.differential_tof())
    if not np.isfinite(apply(left, later).differential_tof()).any():
        later.append(
            Finding("travel times", "not one that can be used", "travel times of some pairs", "refused")
        )
    return findings + later


def _heard(dataset: Dataset, delta: Floats) -> Flags:
    """(ntx, nrx): pairs with a time; one way is enough."""
    known = np.isfinite(delta)
    elements = len(dataset.element_position_m)
    full = np.zeros((elements, elements), dtype=bool)
    full[np.ix_(dataset.tx, dataset.rx)] = known
    return np.asarray((full | full.T)[np.ix_(dataset.tx, dataset.rx)])

"""Examination of a scan: checks of traces, channels and picked times, in this order."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from ...errors import InvalidInput
from ...requests.limits import LEFT_OUT as SHARE
from ...requests.limits import MAX_LEFT_OUT
from ...requests.names import DEFAULT_PICKER
from ..dataset import Dataset
from ..picking.first_arrivals import pick
from .array_shape import COVERAGE, find_limited_angle, inapplicable
from .contradictions import APPARENT, CYCLES, find_contradictions
from .correction import apply, stacked
from .dead import find_dead
from .estimated_water import WATER_SHOT, estimate_water
from .finding import Finding, Report
from .left_out import (
    IMPOSSIBLE,
    LEFT_OUT,
    Pairs,
    count_left_out,
    count_usable,
    find_impossible,
    find_too_few,
)
from .order import ORDER, find_wrong_order
from .recording import Measured, check_traces
from .time_zero import OBJECT, find_time_shift

OF_TIMES = (ORDER, OBJECT, APPARENT, CYCLES, "outliers", "reciprocity")


@dataclass(frozen=True)
class Examined:
    """A scan with its report.

    Attributes:
        report: the findings.
        picked: the corrected dataset with travel times; None for a rejected scan.
    """

    report: Report
    picked: Dataset | None


def examine(
    dataset: Dataset,
    picker: str = DEFAULT_PICKER,
    progress: Callable[[int, int], None] | None = None,
    max_left_out: float = MAX_LEFT_OUT,
    slices: Iterable[Dataset] | None = None,
) -> Examined:
    """Check a scan, correct what can be corrected, pick its times where it has none, and check those.

    Every check is applied to the data as corrected by the previous ones.

    Args:
        dataset: with traces or travel times; without traces if they are only in ``slices``.
        picker: method for missing times.
        progress: called with (emissions done, total); emissions count once for every pass over their traces.
        max_left_out: share of the pairs beyond which a scan is refused, 0 to 1.
        slices: all slices in order; each is released before the next one; traces may be ``Emissions``. None:
            those of ``dataset``.

    Raises:
        InvalidInput: for an unknown picker, and a share outside 0 to 1.
    """
    SHARE.check("max_left_out", max_left_out)
    findings = find_impossible(dataset.impossible_times)
    kept: list[Dataset | None] = []
    counted: list[Pairs] = []
    checked: tuple[str, ...] = ()
    numbers = count(1)
    for k, slice_data in enumerate(slices or map(dataset.slice, range(dataset.slices))):
        total = dataset.slices * len(dataset.tx) * _times_read(slice_data)

        def step(total: int = total) -> None:
            if progress is not None:
                progress(next(numbers), total)

        of_slice, kept_slice, checked = _slice(slice_data, picker, step)
        counted.append(count_left_out(slice_data, of_slice))
        findings += [replace(finding, slice=k) for finding in of_slice]
        kept.append(kept_slice)
    whole = [slice_data for slice_data in kept if slice_data is not None]
    picked = None
    too_few = find_too_few(counted, dataset.impossible_times, max_left_out) if len(whole) == len(kept) else []
    findings += too_few
    if len(whole) == len(kept) and not too_few:
        # A single slice keeps its truth and position; several lose them when sliced.
        combined = whole[0] if dataset.slice_z_m is None else stacked(dataset, whole)
        picked = replace(combined, truth=dataset.truth, waveform=None)
    pairs, usable = count_usable(replace(dataset, tof_s=None, delta_tof_s=None) if picked is None else picked)
    name = "" if dataset.picked else picker
    findings += find_limited_angle(dataset)
    excluded = inapplicable(dataset, checked)
    done = (IMPOSSIBLE, *(name for name in checked if name not in excluded), COVERAGE, LEFT_OUT)
    return Examined(Report(tuple(findings), done, pairs, usable, name, excluded), picked)


def examines_traces(dataset: Dataset, *, traces: bool) -> bool:
    """Whether the traces of a scan are examined, here and in jobs: also beside stored travel times.

    Args:
        dataset: its traces may remain in the file.
        traces: whether there are any.
    """
    return traces and not (dataset.picked and dataset.center_frequency_hz is None)


def _times_read(dataset: Dataset) -> int:
    """Number of passes over an emission of a slice: one per scan to measure it, one to pick it."""
    if dataset.waveform is None or not examines_traces(dataset, traces=True):
        return 0
    return 1 + (dataset.waveform.water is not None) + (not dataset.picked)


def _slice(
    dataset: Dataset, picker: str, step: Callable[[], None]
) -> tuple[list[Finding], Dataset | None, tuple[str, ...]]:
    """Findings of one slice, its corrected dataset, and the checks made; ``step`` is called per emission."""
    findings: list[Finding] = []
    checked: tuple[str, ...] = ()
    measured = None
    if examines_traces(dataset, traces=dataset.waveform is not None):
        measured = Measured.from_dataset(dataset, range(len(dataset.tx)), step)
        findings, checked = check_traces(dataset, measured)
    if any(finding.action == "refused" for finding in findings):
        return findings, None, checked
    dataset = apply(dataset, findings)
    if measured is not None and measured.water is None and not dataset.picked:
        try:
            estimated, reference = estimate_water(dataset, measured.object)
        except InvalidInput as error:
            name = ORDER if error.field == ORDER else WATER_SHOT
            return [*findings, Finding(name, error.value, error.accepted, "refused")], None, checked
        findings += estimated
        if any(finding.action == "refused" for finding in estimated):
            return findings, None, checked
        dataset = reference.applied(apply(dataset, estimated))
    if not dataset.picked:
        dataset = pick(dataset, picker, lambda done, total: step(), screened=False)
    of_times = check_times(dataset)
    findings += of_times
    if any(finding.action == "refused" for finding in of_times):
        return findings, None, checked + OF_TIMES
    return findings, apply(replace(dataset, waveform=None), of_times), checked + OF_TIMES


def check_times(dataset: Dataset) -> list[Finding]:
    """Findings of the travel times of one slice, in the order in which they are applied."""
    findings = find_wrong_order(dataset)
    if findings:
        return findings
    if dataset.valid is None:
        delta = dataset.differential_tof()
        # Pairs with a time in at least one direction.
        detected = np.isfinite(delta) | np.isfinite(dataset.geometry.reverses(delta))
        findings += find_dead(dataset, np.asarray(detected))
    findings += find_time_shift(dataset, dataset.differential_tof())
    if any(finding.action == "refused" for finding in findings):
        return findings
    corrected = apply(replace(dataset, waveform=None), findings)
    later = list(find_contradictions(corrected, corrected.differential_tof()))
    if not np.isfinite(apply(corrected, later).differential_tof()).any():
        later.append(Finding("travel times", "no usable ones", "travel times of some pairs", "refused"))
    return findings + later

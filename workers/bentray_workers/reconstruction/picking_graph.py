"""Task graph of examination and picking: a scan is checked, corrected and picked in batches of emissions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.picking.amplitudes import read_log_ratios
from bentray_kernels.acquisition.picking.first_arrivals import (
    read_times,
    require_traces,
    screen_times,
)
from bentray_kernels.acquisition.quality import Finding
from bentray_kernels.acquisition.quality.chords import examine_chords
from bentray_kernels.acquisition.quality.correction import apply, stacked
from bentray_kernels.acquisition.quality.estimated_water import estimate_from_pulses
from bentray_kernels.acquisition.quality.examination import check_times, examines_traces
from bentray_kernels.acquisition.quality.left_out import (
    count_left_out,
    count_usable,
    find_impossible,
    find_too_few,
)
from bentray_kernels.acquisition.quality.recording import Measured, check_traces
from bentray_kernels.acquisition.reference.chord_pulses import ChordPulses, read_pulses
from bentray_kernels.acquisition.reference.water_chords import WaterChords, find_water_chords
from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import Task
from bentray_kernels.tomography import Progress, Settings

from ..cluster.job_cancellation import check_job_active
from ..files.dataset.scan import ScanHeader, open_slice
from ..files.dataset.write import write_dataset
from ..files.picking_files import (
    ScanFindings,
    reference_path,
    with_reference,
    write_findings,
    write_reference,
)
from .file_scan import read_once
from .trace_sizes import parts_of

PICKED, FINDINGS = "picked.h5", "findings.json"

# Phases of the progress of a job, each counted in emissions.
EXAMINING, PICKING = "examining", "picking"


class PickingFiles(NamedTuple):
    """Results of picking: the picked dataset, unless it equals the scan, and the findings."""

    picked: Path
    findings: Path

    @classmethod
    def in_folder(cls, folder: Path) -> PickingFiles:
        """The files in the folder of a job."""
        return cls(folder / PICKED, folder / FINDINGS)


class EmissionPicks(NamedTuple):
    """Picks of a batch of emissions, (emissions, nrx) each.

    Attributes:
        delta, sigma: s.
        ratio: Np; None without amplitudes.
    """

    delta: Floats
    sigma: Floats
    ratio: Floats | None


class ExaminedChords(NamedTuple):
    """Chords of a slice through water, and the findings in its traces."""

    findings: tuple[Finding, ...]
    chords: WaterChords


class PickingSource(NamedTuple):
    """The scan for tasks; ``stamp`` distinguishes a rewritten file from the old one.

    Attributes:
        folder: of the job; once it is removed, tasks end with their present emission.
        settings: of the job.
    """

    path: Path
    stamp: int
    folder: Path
    settings: Settings

    @property
    def dataset(self) -> Dataset:
        """The scan without its traces."""
        return self.header.dataset

    @property
    def header(self) -> ScanHeader:
        """Facts about the scan without its traces."""
        return read_once(self.path, self.stamp, self.settings.water_temperature_c)

    @property
    def examines_traces(self) -> bool:
        """Whether traces are examined."""
        traces = self.header.samples > 0
        return self.settings.picking.examine and examines_traces(self.dataset, traces=traces)

    @property
    def reads_times_or_amplitudes(self) -> bool:
        """Whether travel times or amplitudes are read from the traces."""
        return self.settings.reads_amplitudes or not self.dataset.picked

    @property
    def estimates_water(self) -> bool:
        """Whether a water shot is needed and must be estimated, because the file has none."""
        needed = self.settings.method == "waveform" or self.reads_times_or_amplitudes
        return needed and self.header.lacks_water and self.dataset.center_frequency_hz is not None

    @contextmanager
    def slice(self, index: int, findings: Sequence[Finding] = ()) -> Iterator[Dataset]:
        """One slice with traces that are read on access, with the findings corrected."""
        with open_slice(self.path, self.dataset, index, partial(check_job_active, self.folder)) as dataset:
            yield apply(dataset, findings)

    @contextmanager
    def with_water(self, index: int, findings: Sequence[Finding]) -> Iterator[Dataset]:
        """Open a slice by ``slice``, with the estimated water shot where the file has none."""
        with self.slice(index, findings) as dataset:
            yield with_reference(dataset, self.folder, index)


class PickingGraph:
    """Task graph of examination and picking; its result is ``Files``.

    The traces of a scan with travel times are examined too, and read if amplitudes are taken from them.

    Args:
        source: the scan.
        files: to write, in a folder that every worker can write.

    Raises:
        InvalidInput: for a scan without times or amplitudes, and without the traces to read them from.
    """

    def __init__(self, source: PickingSource, files: PickingFiles) -> None:
        self._source, self._files = source, files
        dataset = source.dataset
        self._slices = range(dataset.slices)
        self._parts: list[range] = []
        self._picks = source.reads_times_or_amplitudes
        if self._picks:
            with source.slice(0) as scan_2d:
                require_traces(scan_2d, water=False)
        self._estimates = source.estimates_water
        self._examines = source.examines_traces
        if self._picks or self._estimates or self._examines:
            self._parts = parts_of(len(dataset.tx), source.header.samples * len(dataset.rx))
        self._measures = self._examines or self._estimates
        # Of the object, until the chords through water are found in them.
        self._measured: dict[int, list[Any]] = {}
        self._findings: dict[int, Any] = dict.fromkeys(self._slices, ())
        self._results: dict[tuple[Any, int], dict[int, Any]] = defaultdict(dict)
        self._emissions_done: dict[Any, int] = defaultdict(int)

    @property
    def progress(self) -> Progress:
        """Emissions examined, then emissions picked, of all; 0 of 0 if no traces are read."""
        total = len(self._slices) * sum(map(len, self._parts))
        examined = self._emissions_done[measure_traces] + self._emissions_done[read_chords]
        to_examine = total * (self._measures + self._estimates)
        if examined < to_examine:
            return Progress(examined, to_examine, phase=EXAMINING)
        return Progress(self._emissions_done[pick_emissions], total if self._picks else 0, phase=PICKING)

    @property
    def done(self) -> int:
        return self.progress.done

    @property
    def total(self) -> int:
        return self.progress.total

    def first(self) -> list[Task]:
        if self._measures:
            return [task for k in self._slices for task in self._each_part(measure_traces, k)]
        return [task for k in self._slices for task in self._picking(k)]

    def after(self, task: Task, result: Any) -> list[Task]:
        if task.function is write_picked:
            return []
        index = task.arguments[1]
        if task.function is examine_slice:
            self._findings[index] = result
            return self._chords(index) if self._estimates else self._picking(index)
        if task.function is find_chords:
            return self._each_part(read_chords, index, result)
        if task.function is estimate_slice_water:
            self._findings[index] = result
            return self._picking(index)
        if task.function is finish_slice:
            finished = self._results[finish_slice, 0]
            finished[index] = result
            if len(finished) < len(self._slices):
                return []
            return [Task(write_picked, (self._source, self._files, self._pop(finish_slice, 0)))]
        emissions: range = task.arguments[-1]
        self._emissions_done[task.function] += len(emissions)
        self._results[task.function, index][emissions.start] = result
        if len(self._results[task.function, index]) < len(self._parts):
            return []
        pieces = self._pop(task.function, index)
        if task.function is measure_traces:
            self._measured[index] = pieces if self._estimates else []
            if not self._examines:
                return self._chords(index)
            return [Task(examine_slice, (self._source, index, pieces), keep_on_worker=True)]
        if task.function is read_chords:
            findings = task.arguments[2]
            return [Task(estimate_slice_water, (self._source, index, findings, pieces), keep_on_worker=True)]
        arguments = self._source, index, self._findings[index], pieces
        return [Task(finish_slice, arguments, keep_on_worker=True)]

    def _chords(self, index: int) -> list[Task]:
        """The task that finds the chords through water of a slice."""
        arguments = self._source, index, self._findings[index], self._measured.pop(index)
        return [Task(find_chords, arguments, keep_on_worker=True)]

    def _picking(self, index: int) -> list[Task]:
        """The tasks that pick a slice, or the one that finishes it."""
        findings = self._findings[index]
        if self._picks:
            return self._each_part(pick_emissions, index, findings)
        return [Task(finish_slice, (self._source, index, findings, []), keep_on_worker=True)]

    def _each_part(self, function: Callable[..., Any], index: int, *arguments: Any) -> list[Task]:
        """A task for each batch of emissions of a slice."""
        return [
            Task(function, (self._source, index, *arguments, emissions), keep_on_worker=True)
            for emissions in self._parts
        ]

    def _pop(self, function: Any, index: int) -> list[Any]:
        """Results of the tasks of a kind in order, and forget them."""
        return [result for _, result in sorted(self._results.pop((function, index)).items())]


def measure_traces(source: PickingSource, index: int, emissions: range) -> Measured:
    """Task: statistics of the traces of a batch of emissions."""
    with source.slice(index) as dataset:
        return Measured.from_dataset(dataset, emissions)


def examine_slice(source: PickingSource, index: int, measured: list[Measured]) -> tuple[Finding, ...]:
    """Task: findings in the traces of a slice; an unusable scan is rejected."""
    with source.slice(index) as dataset:
        findings, _ = check_traces(dataset, Measured.joined(measured))
    return _usable(source, index, findings)


def find_chords(
    source: PickingSource, index: int, findings: tuple[Finding, ...], measured: list[Measured]
) -> ExaminedChords:
    """Task: the chords of a slice through water, from which its water shot is estimated, and all findings."""
    dataset = apply(source.dataset.slice(index), findings)
    measures = Measured.joined(measured).object
    if source.settings.picking.examine:
        more, chords = examine_chords(dataset, measures)
        return ExaminedChords((*findings, *_usable(source, index, more)), chords)
    return ExaminedChords(findings, find_water_chords(dataset, measures.strongest_s))


def read_chords(source: PickingSource, index: int, examined: ExaminedChords, emissions: range) -> ChordPulses:
    """Task: pulses of the chords through water in a batch of emissions."""
    with source.slice(index, examined.findings) as dataset:
        return read_pulses(dataset, emissions, examined.chords)


def estimate_slice_water(
    source: PickingSource, index: int, examined: ExaminedChords, pulses_read: list[ChordPulses]
) -> tuple[Finding, ...]:
    """Task: estimate the water shot of a slice and write it; the findings with what was estimated."""
    dataset = apply(source.dataset.slice(index), examined.findings)
    pulses = ChordPulses.joined(pulses_read)
    later, reference = estimate_from_pulses(
        dataset, examined.chords, pulses, examine=source.settings.picking.examine
    )
    write_reference(reference_path(source.folder, index), reference)
    return (*examined.findings, *_usable(source, index, later))


def pick_emissions(
    source: PickingSource, index: int, findings: tuple[Finding, ...], emissions: range
) -> EmissionPicks:
    """Task: times of a batch of emissions with standard deviations, and amplitudes if needed."""
    settings = source.settings
    with source.with_water(index, findings) as dataset:
        if dataset.picked:
            delta = dataset.differential_tof()[emissions.start : emissions.stop]
            sigma = np.full_like(delta, np.nan)
        else:
            require_traces(dataset)
            delta, sigma = read_times(dataset, emissions, settings.picking.picker)
        ratio = None
        if settings.reads_amplitudes:
            ratio = read_log_ratios(dataset, emissions, delta, settings.attenuation.amplitudes)
        return EmissionPicks(delta, sigma, ratio)


def finish_slice(
    source: PickingSource, index: int, findings: tuple[Finding, ...], picks: list[EmissionPicks]
) -> tuple[Dataset, tuple[Finding, ...]]:
    """Task: one slice to reconstruct, without traces, and all findings in it."""
    dataset, picking = apply(source.dataset.slice(index), findings), source.settings.picking
    if picks and not dataset.picked:
        delta, sigma = (np.concatenate(rows) for rows in zip(*(pick[:2] for pick in picks), strict=True))
        delta, sigma = screen_times(dataset, delta, sigma, screened=not picking.examine)
        dataset = replace(dataset, delta_tof_s=delta, sigma_s=sigma, tof_s=None, picker=picking.picker)
    if source.settings.reads_amplitudes:
        ratio = np.concatenate([pick.ratio for pick in picks if pick.ratio is not None])
        ratio = np.where(np.isfinite(dataset.differential_tof()), ratio, np.nan)
        dataset = replace(dataset, log_ratio_np=ratio, amplitude_frequency_hz=dataset.center_frequency_hz)
    if picking.examine:
        later = _usable(source, index, check_times(dataset))
        dataset, findings = apply(dataset, later), (*findings, *later)
    return dataset, findings


def write_picked(
    source: PickingSource, files: PickingFiles, slices: list[tuple[Dataset, tuple[Finding, ...]]]
) -> None:
    """Task: write the picked dataset, unless it equals the scan, and then all findings."""
    whole, picking = source.dataset, source.settings.picking
    impossible = find_impossible(whole.impossible_times)
    counted = [count_left_out(whole.slice(k), of_slice) for k, (_, of_slice) in enumerate(slices)]
    if picking.examine:
        too_few = find_too_few(counted, whole.impossible_times, picking.max_left_out)
        _usable(source, 0, too_few)
    of_slices = (replace(finding, slice=k) for k, (_, faults) in enumerate(slices) for finding in faults)
    findings = (*impossible, *of_slices)
    corrected = any(finding.action != "reported" for finding in findings)
    changed = source.reads_times_or_amplitudes or corrected
    datasets = [dataset for dataset, _ in slices]
    picked = datasets[0] if whole.slice_z_m is None else stacked(whole, datasets)
    if changed:
        write_dataset(files.picked, replace(picked, truth=whole.truth))
    left_out = sum(pairs.left_out for pairs in counted)
    record = ScanFindings(findings, picking.examine, changed, *count_usable(picked), left_out)
    write_findings(files.findings, record, files.picked if changed else None)


def _usable(source: PickingSource, index: int, findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """The findings, unless one of them rejects the scan.

    Raises:
        InvalidInput: for a rejected scan.
    """
    for finding in findings:
        if finding.action == "refused":
            where = f" (slice {index})" if source.dataset.slice_z_m is not None else ""
            raise InvalidInput(
                finding.check,
                finding.found + where,
                f"{finding.accepted}; with examine false the scan is used unchanged",
            )
    return tuple(findings)

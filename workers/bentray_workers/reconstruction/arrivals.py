"""What a reconstruction begins with: a scan examined, corrected and picked, a batch of emissions a task."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.picking.amplitudes import read_log_ratios
from bentray_kernels.acquisition.picking.first_arrivals import reach_of, read_times, require_traces, settled
from bentray_kernels.acquisition.quality import Finding
from bentray_kernels.acquisition.quality.correction import apply, stacked
from bentray_kernels.acquisition.quality.examination import times_judged
from bentray_kernels.acquisition.quality.recording import Measured, judged
from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import Task
from bentray_kernels.tomography import Progress
from bentray_kernels.tomography.guided_picking import predicted_delta

from ..cluster.job_cancellation import check_job_active
from ..files.dataset.traces import slice_opened, trace_samples
from ..files.dataset.write import write_dataset
from ..files.findings import Found, read_findings, write_findings
from ..files.reconstruction import read_reconstruction
from .file_scan import read_once
from .memory.arrival_memory import parts_of

PICKED, FINDINGS = "picked.h5", "findings.json"

# Phases of a job's progress, each with emissions gone through of all.
EXAMINING, PICKING = "examining", "picking"


class Files(NamedTuple):
    """What is made: what goes on, unless it is the scan's own file, and what was found."""

    picked: Path
    findings: Path

    @classmethod
    def of(cls, folder: Path, number: int = 0) -> Files:
        """Those of a round of picking in the folder of a job, the first being 0."""
        before = f"{number}-" if number else ""
        return cls(folder / (before + PICKED), folder / (before + FINDINGS))


class Guide(NamedTuple):
    """What tells where arrivals are to be sought: the file of an image, and of what the traces showed."""

    image: Path
    findings: Path

    def predicted(self, one: Dataset, index: int, part: range) -> Floats:
        """(ntx, nrx), s: object minus water as the image has it; NaN but for some emissions of a slice."""
        found, rows = np.full((len(one.tx), len(one.rx)), np.nan), slice(part.start, part.stop)
        image = read_reconstruction(self.image)
        speed = image.speed if image.speed.ndim == 2 else image.speed[:, :, index]
        bare = replace(one, waveform=None, valid=None, tof_s=None, sigma_s=None, log_ratio_np=None)
        some = replace(bare, tx=one.tx[rows], delta_tof_s=found[rows])
        found[rows] = predicted_delta(some, replace(image, speed=speed))
        return found

    def faults(self, index: int) -> tuple[Finding, ...]:
        """What the traces of a slice showed."""
        return read_findings(self.findings).of_traces(index)


class Heard(NamedTuple):
    """What the traces of some emissions gave, (emissions, nrx) each.

    Attributes:
        delta, sigma: s.
        ratio: Np; None where amplitudes are not wanted.
    """

    delta: Floats
    sigma: Floats
    ratio: Floats | None


class Source(NamedTuple):
    """The scan as calls know it; ``stamp`` tells a rewritten file from the old one.

    Attributes:
        folder: of the job; once it has gone, calls end with the emission that they are at.
        picker: what reads the times of a scan without them.
        examine: whether the scan is examined first.
        amplitudes: where they come from, see ``Settings``.
    """

    path: Path
    stamp: int
    folder: Path
    picker: str
    examine: bool
    amplitudes: str = "recorded"

    @property
    def dataset(self) -> Dataset:
        """Without its traces."""
        return read_once(self.path, self.stamp)

    @property
    def examines(self) -> bool:
        """Whether times are examined: nothing but the period tells how far two neighbours may differ."""
        return self.examine and self.dataset.center_frequency_hz is not None

    @property
    def listens(self) -> bool:
        """Whether amplitudes are read from the traces."""
        return self.amplitudes != "recorded"

    @contextmanager
    def slice(self, index: int, findings: Sequence[Finding] = ()) -> Iterator[Dataset]:
        """One slice with traces that are read as they are asked for, and what was found corrected."""
        with slice_opened(self.path, self.dataset, index, partial(check_job_active, self.folder)) as one:
            yield apply(one, findings)


class PickingGraph:
    """Task graph of examination and picking; its result is ``Files``.

    Of a scan with times of its own these alone are examined, see ``Source.examines``; its traces are read
    where amplitudes are wanted from them.

    Args:
        source: the scan.
        files: in a folder that every worker can write.
        guide: of a scan without times that was picked before: what the new times are sought by.

    Raises:
        InvalidInput: for a scan without times from which none can be read, or without the amplitudes.
    """

    def __init__(self, source: Source, files: Files, guide: Guide | None = None) -> None:
        self._source, self._files, self._guide = source, files, guide
        dataset = source.dataset
        self._slices = range(dataset.slices)
        self._parts: list[range] = []
        if source.listens or not dataset.picked:
            with source.slice(0) as one:
                require_traces(one)
            self._parts = parts_of(len(dataset.tx), trace_samples(source.path) * len(dataset.rx))
        self._found: dict[int, Any] = {k: guide.faults(k) if guide else () for k in self._slices}
        self._given: dict[tuple[Any, int], dict[int, Any]] = defaultdict(dict)
        self._gone_through: dict[Any, int] = defaultdict(int)

    @property
    def progress(self) -> Progress:
        """How far it is: emissions examined, then emissions picked, of all; none where no traces are read."""
        total = len(self._slices) * sum(map(len, self._parts))
        examined, picked = self._gone_through[measure], self._gone_through[read]
        examines = self._source.examine and not self._source.dataset.picked and not self._guide
        if examines and examined < total:
            return Progress(examined, total, phase=EXAMINING)
        return Progress(picked, total, phase=PICKING)

    @property
    def done(self) -> int:
        return self.progress.done

    @property
    def total(self) -> int:
        return self.progress.total

    def first(self) -> list[Task]:
        if not self._parts:
            return [Task(settle, (self._source, k, (), []), keep_on_worker=True) for k in self._slices]
        if self._guide or not self._source.examine or self._source.dataset.picked:
            return [call for k in self._slices for call in self._reading(k)]
        return [
            Task(measure, (self._source, k, part), keep_on_worker=True)
            for k in self._slices
            for part in self._parts
        ]

    def after(self, task: Task, result: Any) -> list[Task]:
        if task.function is join:
            return []
        index = task.arguments[1]
        if task.function is judge:
            self._found[index] = result
            return self._reading(index)
        if task.function is settle:
            settled_slices = self._given[settle, 0]
            settled_slices[index] = result
            if len(settled_slices) < len(self._slices):
                return []
            return [Task(join, (self._source, self._files, self._taken(settle, 0)))]
        part: range = task.arguments[-1]
        self._gone_through[task.function] += len(part)
        self._given[task.function, index][part.start] = result
        if len(self._given[task.function, index]) < len(self._parts):
            return []
        parts = self._taken(task.function, index)
        if task.function is measure:
            return [Task(judge, (self._source, index, parts), keep_on_worker=True)]
        return [Task(settle, (self._source, index, self._found[index], parts), keep_on_worker=True)]

    def _reading(self, index: int) -> list[Task]:
        how = self._source, index, self._found[index], self._guide
        return [Task(read, (*how, part), keep_on_worker=True) for part in self._parts]

    def _taken(self, function: Any, index: int) -> list[Any]:
        """What the calls of a kind gave, in order; it is let go of here."""
        return [given for _, given in sorted(self._given.pop((function, index)).items())]


def measure(source: Source, index: int, part: range) -> Measured:
    """Task: the figures of the traces of some emissions."""
    with source.slice(index) as one:
        return Measured.of(one, part)


def judge(source: Source, index: int, parts: list[Measured]) -> tuple[Finding, ...]:
    """Task: what the traces of a slice show; a scan that must not be used is refused."""
    with source.slice(index) as one:
        findings, _ = judged(one, Measured.joined(parts))
    return _accepted(source, index, findings)


def read(
    source: Source, index: int, findings: tuple[Finding, ...], guide: Guide | None, part: range
) -> Heard:
    """Task: the times of some emissions with their deviations, and amplitudes where these are wanted."""
    with source.slice(index, findings) as one:
        if one.picked:
            delta = one.differential_tof()[part.start : part.stop]
            sigma = np.full_like(delta, np.nan)
        else:
            if guide is None:
                predicted = np.full((len(one.tx), len(one.rx)), np.nan)
            else:
                predicted = guide.predicted(one, index, part)
            delta, sigma = read_times(one, part, source.picker, predicted, reach_of(one, source.picker))
        ratio = read_log_ratios(one, part, delta, source.amplitudes) if source.listens else None
        return Heard(delta, sigma, ratio)


def settle(
    source: Source, index: int, findings: tuple[Finding, ...], parts: list[Heard]
) -> tuple[Dataset, tuple[Finding, ...]]:
    """Task: one slice as it goes on, without traces, and all that was found in it."""
    one = apply(source.dataset.slice(index), findings)
    if parts and not one.picked:
        delta, sigma = (np.concatenate(rows) for rows in zip(*(part[:2] for part in parts), strict=True))
        delta, sigma = settled(one, delta, sigma, screened=not source.examine)
        one = replace(one, delta_tof_s=delta, sigma_s=sigma, tof_s=None, picker=source.picker)
    if source.listens:
        ratio = np.concatenate([part.ratio for part in parts if part.ratio is not None])
        ratio = np.where(np.isfinite(one.differential_tof()), ratio, np.nan)
        one = replace(one, log_ratio_np=ratio, amplitude_frequency_hz=one.center_frequency_hz)
    if source.examines:
        later = _accepted(source, index, times_judged(one))
        one, findings = apply(one, later), (*findings, *later)
    return one, findings


def join(source: Source, files: Files, slices: list[tuple[Dataset, tuple[Finding, ...]]]) -> None:
    """Task: write what goes on, unless it is what the file has anyway, and then all findings."""
    whole = source.dataset
    findings = tuple(replace(finding, slice=k) for k, (_, found) in enumerate(slices) for finding in found)
    changed = source.listens or not whole.picked or any(finding.action != "reported" for finding in findings)
    if changed:
        parts = [one for one, _ in slices]
        shown = parts[0] if whole.slice_z_m is None else stacked(whole, parts)
        write_dataset(files.picked, replace(shown, truth=whole.truth))
    found = Found(findings, source.examines, changed)
    write_findings(files.findings, found, files.picked if changed else None)


def _accepted(source: Source, index: int, findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """The findings.

    Raises:
        InvalidInput: where one of them refuses the scan.
    """
    for finding in findings:
        if finding.action == "refused":
            where = f" (slice {index})" if source.dataset.slice_z_m is not None else ""
            raise InvalidInput(
                finding.check,
                finding.found + where,
                f"{finding.accepted}; with examine false the scan is taken as it is",
            )
    return tuple(findings)

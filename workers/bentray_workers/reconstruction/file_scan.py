"""A scan for tasks: a file and settings; every process reads it once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.quality.correction import apply
from bentray_kernels.tomography import Problem, Settings
from bentray_kernels.tomography.grid_schedule import stages
from bentray_kernels.tomography.model_selection.held_out import Part
from bentray_kernels.tomography.reconstruction import problem_of
from bentray_kernels.tomography.waveform.preparation import prepare
from bentray_kernels.tomography.waveform.waveform_problem import WaveProblem
from bentray_kernels.tomography.waveform.waveform_settings import WaveSettings

from ..cluster.job_cancellation import check_job_active
from ..files.dataset.scan import read_scan
from ..files.dataset.traces import open_slice
from ..files.findings import read_findings
from ..files.reference import with_reference
from .memory.ray_memory import PROBLEMS_KEPT


class FileScan(NamedTuple):
    """See ``tomography.stage_graphs.Scan``; ``stamp`` distinguishes a rewritten file from the old one."""

    path: Path
    stamp: int
    settings: Settings
    part: Part

    def stages(self) -> tuple[Settings, ...]:
        return _stages(self)

    def problem(self, index: int, stage: int = -1) -> Problem:
        return _problem(self, index, stage % len(self.stages()))

    def problems(self, indices: tuple[int, ...], stage: int = -1) -> tuple[Problem, ...]:
        return _problems(self, indices, stage % len(self.stages()))


class FileWaveScan(NamedTuple):
    """See ``tomography.waveform.refinement_graph.WaveScan``; ``path`` is that of a file with traces.

    Attributes:
        findings: the file of findings in the scan; faulty traces are corrected or left out. Tasks end within
            a second once its folder, that of the job, is removed.
        water_temperature_c: in place of that of the file, °C.
    """

    path: Path
    stamp: int
    plan: WaveSettings
    slice: int
    findings: Path
    water_temperature_c: float | None = None

    def settings(self) -> WaveSettings:
        return self.plan

    def problem(self, number: int) -> WaveProblem:
        return _wave_problem(self, number)


class FileEchoScan(NamedTuple):
    """See ``tomography.reflection.reflection_plan.EchoScan``; attributes as of ``FileWaveScan``."""

    path: Path
    stamp: int
    slice: int
    findings: Path
    water_temperature_c: float | None = None

    @contextmanager
    def open(self) -> Iterator[Dataset]:
        faults = read_findings(self.findings).of_traces(self.slice)
        poll = partial(check_job_active, self.findings.parent)
        recorded = read_once(self.path, self.stamp, self.water_temperature_c)
        with open_slice(self.path, recorded, self.slice, poll) as one:
            yield apply(one, faults)


@lru_cache(maxsize=16)
def _stages(scan: FileScan) -> tuple[Settings, ...]:
    return stages(read_once(scan.path, scan.stamp, scan.settings.water_temperature_c), scan.settings)


@lru_cache(maxsize=PROBLEMS_KEPT)
def _problem(scan: FileScan, index: int, stage: int) -> Problem:
    return _new_problem(scan, index, stage)


# Of one job: all slices that a device updates together.
@lru_cache(maxsize=1)
def _problems(scan: FileScan, indices: tuple[int, ...], stage: int) -> tuple[Problem, ...]:
    return tuple(_new_problem(scan, index, stage) for index in indices)


def _new_problem(scan: FileScan, index: int, stage: int) -> Problem:
    dataset = read_once(scan.path, scan.stamp, scan.settings.water_temperature_c)
    return problem_of(dataset, scan.stages()[stage], index, scan.part)


@lru_cache(maxsize=2)
def read_once(path: Path, stamp: int, water_temperature_c: float | None = None) -> Dataset:
    """A dataset without its traces.

    Args:
        path: of its file.
        stamp: distinguishes a rewritten file from the old one.
        water_temperature_c: in place of that of the file, °C; a file picked from it states it already.
    """
    # Before the first task, the run held the times against the positions.
    return read_scan(path, plausible=False).in_water_of(water_temperature_c)


# Two jobs may alternate; more would cost memory, since a problem holds the traces of the object.
@lru_cache(maxsize=2)
def _wave_problem(scan: FileWaveScan, number: int) -> WaveProblem:
    faults = read_findings(scan.findings).of_traces(scan.slice)
    poll = partial(check_job_active, scan.findings.parent)
    recorded = read_once(scan.path, scan.stamp, scan.water_temperature_c)
    with open_slice(scan.path, recorded, scan.slice, poll) as one:
        whole = with_reference(apply(one, faults), scan.findings.parent, scan.slice)
        return prepare(whole, scan.plan, number, poll=poll)

"""A scan as tasks know it: a file and settings; every process reads what it needs once."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Problem, Settings
from bentray_kernels.tomography.advice import Part, part_of
from bentray_kernels.tomography.reconstruction import problem_of
from bentray_kernels.tomography.stages import stages
from bentray_kernels.wave import WaveProblem, WaveSettings, prepare

from .dataset_file import read_dataset
from .trace_reading import read_slice


class FileScan(NamedTuple):
    """See ``bentray_kernels.tomography.chains.Scan``; ``stamp`` tells a rewritten file from the old one."""

    path: Path
    stamp: int
    settings: Settings
    part: Part

    def stages(self) -> tuple[Settings, ...]:
        return _stages(self)

    def problem(self, index: int, stage: int = -1) -> Problem:
        return _problem(self, index, stage % len(self.stages()))


class FileWaveScan(NamedTuple):
    """See ``bentray_kernels.wave.WaveScan``; ``path`` is that of a file with traces."""

    path: Path
    stamp: int
    plan: WaveSettings
    slice: int

    def settings(self) -> WaveSettings:
        return self.plan

    def problem(self, number: int) -> WaveProblem:
        return _wave_problem(self, number)


@lru_cache(maxsize=16)
def _stages(scan: FileScan) -> tuple[Settings, ...]:
    return stages(_dataset(scan.path, scan.stamp), scan.settings)


@lru_cache(maxsize=8)
def _problem(scan: FileScan, index: int, stage: int) -> Problem:
    dataset = part_of(_dataset(scan.path, scan.stamp), scan.part)
    return problem_of(dataset, scan.stages()[stage], index)


@lru_cache(maxsize=2)
def _dataset(path: Path, stamp: int) -> Dataset:
    return read_dataset(path, traces=False)


# Two jobs may take turns; more would cost memory, for a problem holds the traces of the object.
@lru_cache(maxsize=2)
def _wave_problem(scan: FileWaveScan, number: int) -> WaveProblem:
    # Not by way of what is cached, for the traces of the water are not needed any longer.
    return prepare(read_slice(scan.path, scan.slice), scan.plan, number)

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

from .dataset_file import read_dataset


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

"""A slice of a scan in the memory of this process, for tasks of a waveform refinement."""

from __future__ import annotations

from functools import cache

from ...acquisition import Dataset
from .preparation import prepare
from .waveform_problem import WaveProblem
from .waveform_settings import WaveSettings


class MemoryWaveScan:
    """See ``refinement_graph.WaveScan``."""

    def __init__(self, dataset: Dataset, settings: WaveSettings, *, index: int = 0) -> None:
        self._settings = settings
        self._problem = cache(lambda number: prepare(dataset.slice(index), settings, number))

    def settings(self) -> WaveSettings:
        return self._settings

    def problem(self, number: int) -> WaveProblem:
        problem: WaveProblem = self._problem(number)
        return problem

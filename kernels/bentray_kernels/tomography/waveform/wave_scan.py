"""A slice of a scan as the tasks of a waveform refinement see it."""

from typing import NamedTuple

from ..scan import Source
from .preparation import prepare
from .waveform_problem import WaveProblem
from .waveform_settings import WaveSettings


class WaveScan(NamedTuple):
    """The problems of one slice with the settings of its refinement; it is sent with tasks."""

    source: Source
    plan: WaveSettings
    slice: int = 0

    def problem(self, number: int) -> WaveProblem:
        """The problem of a band, from 0; made once in a process."""
        problem: WaveProblem = self.source.once(wave_problem_of, self, number)
        return problem


def wave_problem_of(scan: WaveScan, number: int) -> WaveProblem:
    """The problem of a band of one slice, see ``prepare``."""
    with scan.source.traces(scan.slice, estimated_water=True) as dataset:
        return prepare(dataset, scan.plan, number, poll=scan.source.poll)

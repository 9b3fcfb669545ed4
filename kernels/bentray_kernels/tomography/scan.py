"""A scan as tasks see it: where its data are, and the problems that a process makes of them once."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import cache
from typing import Any, NamedTuple, Protocol

from ..acquisition import Dataset
from ..wave.time_blocks import Poll, no_poll
from .grid_schedule import stages
from .held_out import Part, part_of
from .problem import Problem
from .settings import Settings


class Source(Protocol):
    """Where tasks find a scan; it is sent with them, so it holds a path or the dataset itself.

    Attributes:
        samples: of each trace of the object; 0 without traces.
        has_water: whether traces of the water are recorded, or were estimated.
        estimates_source: whether a refinement estimates the source of its waves from traces of the object.
        poll: of simulations, see ``time_blocks``.
    """

    @property
    def samples(self) -> int: ...

    @property
    def has_water(self) -> bool: ...

    @property
    def estimates_source(self) -> bool: ...

    @property
    def poll(self) -> Poll: ...

    def dataset(self) -> Dataset:
        """The scan with its travel times; its traces may be in a file."""

    def traces(self, index: int, *, estimated_water: bool = False) -> AbstractContextManager[Dataset]:
        """One slice with its traces, which may be read on access while the context is open.

        Args:
            index: of the slice, from 0.
            estimated_water: with the estimated water shot, where none is recorded.
        """

    def once(self, make: Callable[..., Any], /, *arguments: Any) -> Any:
        """The value of ``make`` for these arguments, made once in a process; the last few are kept."""


class MemorySource:
    """A dataset in the memory of this process, see ``Source``."""

    estimates_source = False
    poll = staticmethod(no_poll)

    def __init__(self, dataset: Dataset) -> None:
        self._dataset, recorded = dataset, dataset.waveform
        self.samples = 0 if recorded is None else int(recorded.object.shape[-1])
        self.has_water = recorded is not None and recorded.water is not None
        self.once = cache(lambda make, /, *arguments: make(*arguments))

    def dataset(self) -> Dataset:
        """See ``Source``."""
        return self._dataset

    @contextmanager
    def traces(self, index: int, *, estimated_water: bool = False) -> Iterator[Dataset]:
        """See ``Source``."""
        yield self._dataset.slice(index)


class Scan(NamedTuple):
    """The problems of a part of the pairs with settings, for images by rays."""

    source: Source
    settings: Settings
    part: Part = "all"

    def stages(self) -> tuple[Settings, ...]:
        """Settings of each stage, see ``grid_schedule``."""
        stages: tuple[Settings, ...] = self.source.once(stages_of, self)
        return stages

    def problem(self, index: int, stage: int = -1) -> Problem:
        """The problem of one slice at a stage, the last by default."""
        problem: Problem = self.source.once(problem_of, self, index, stage % len(self.stages()))
        return problem

    def problems(self, indices: tuple[int, ...], stage: int = -1) -> tuple[Problem, ...]:
        """Those of several slices that are updated together."""
        together: tuple[Problem, ...] = self.source.once(
            problems_of, self, indices, stage % len(self.stages())
        )
        return together


def stages_of(scan: Scan) -> tuple[Settings, ...]:
    """The settings of each stage of a scan."""
    return stages(scan.source.dataset(), scan.settings)


def problem_of(scan: Scan, index: int, stage: int) -> Problem:
    """The problem of one slice for the method of a stage, with the pairs of one part.

    Held-out pairs that were measured both ways have their mean, for every method: with half the variance
    of the noise for one method, and all of it for another, misfits could not be compared.

    Raises:
        InvalidInput: as ``Problem.from_dataset``.
    """
    settings = scan.stages()[stage]
    problem = Problem.from_dataset(part_of(scan.source.dataset(), scan.part), settings, index)
    once = settings.method == "gauss-newton" or not (scan.part == "all" or scan.part.startswith("shown"))
    return problem.each_pair_once() if once and settings.numerics.reciprocity else problem


def problems_of(scan: Scan, indices: tuple[int, ...], stage: int) -> tuple[Problem, ...]:
    """The problems of several slices."""
    return tuple(problem_of(scan, index, stage) for index in indices)

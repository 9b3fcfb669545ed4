"""What is to be done for one slice, as tasks: one after the other for SART, side by side for Gauss–Newton."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from distributed import Future

from bentray_kernels.acquisition import Dataset
from bentray_kernels.arrays import Floats
from bentray_kernels.tomography import Settings, SliceProblem, attenuation, gauss_newton, sart
from bentray_kernels.tomography.linearisation import Rows
from bentray_kernels.tomography.reconstruction import State, batches, batches_of_losses, problem_of

from .dataset_file import read_dataset

# Long enough that scheduling costs nothing, short enough to show progress and to stop soon.
TASK_S = 0.5
FIRST_BATCH = 8


class Scan(NamedTuple):
    """A file and the settings it is reconstructed with; ``stamp`` tells a rewritten file from the old one."""

    path: Path
    stamp: int
    settings: Settings


class Call(NamedTuple):
    """A task that may run now."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]


class Chain(ABC):
    """The tasks of one slice: those of its speed, then those of its attenuation where it has amplitudes.

    Attributes:
        state: where the slice stands.
        looked: emitters whose rays are traced, of a step that is not made.
    """

    def __init__(self, scan: Scan, index: int, start: State) -> None:
        self._scan, self._index = scan, index
        self._rows: dict[int, Future] = {}
        self._losses = [len(part) for part in batches_of_losses(problem(scan, index), scan.settings)]
        self.state = start
        self.looked = 0

    @abstractmethod
    def first(self) -> list[Call]:
        """Tasks to begin with."""

    def after(self, call: Call, future: Future) -> list[Call]:
        """Tasks that may follow one that has finished; raises what that one raised."""
        if call.function is attenuate:
            self.state = replace(self.state, attenuation=self._stepped(future))
            return []
        if call.function is look_losses:
            return self._gathered(call, future, self._losses, attenuate)
        follow = self._next(call, future)
        if follow or not self.state.done:
            return follow
        image = self.state.slowness
        return [
            Call(look_losses, (self._scan, self._index, image, part)) for part in range(len(self._losses))
        ]

    @abstractmethod
    def _next(self, call: Call, future: Future) -> list[Call]:
        """As ``after``, for the tasks of the speed."""

    def _gathered(
        self, call: Call, future: Future, sizes: list[int], then: Callable[..., Any], *given: Any
    ) -> list[Call]:
        """Keep one part's rows with the worker that made them; with the last part, what uses them all."""
        if future.status != "finished":
            future.result()
        part = call.arguments[-1]
        self._rows[part] = future
        self.looked += sizes[part]
        if len(self._rows) < len(sizes):
            return []
        rows = [rows for _, rows in sorted(self._rows.items())]
        return [Call(then, (self._scan, self._index, *given, rows))]

    def _stepped(self, future: Future) -> Any:
        """What a step gave; its rows are let go."""
        found = future.result()
        self._rows, self.looked = {}, 0
        return found


def chain(scan: Scan, index: int, start: State) -> Chain:
    """The chain of one slice, for the method that the settings ask for."""
    return (SartChain if isinstance(start, sart.State) else GaussNewtonChain)(scan, index, start)


class SartChain(Chain):
    """Batches of emitters, each used on the image that the one before left."""

    _batch = FIRST_BATCH

    def first(self) -> list[Call]:
        return [Call(advance, (self._scan, self._index, self.state, self._batch))]

    def _next(self, call: Call, future: Future) -> list[Call]:
        used = -self.state.emitter
        self.state, seconds = future.result()
        self._batch = next_batch(self._batch, used + self.state.emitter, seconds)
        return [] if self.state.done else self.first()


class GaussNewtonChain(Chain):
    """The rays of all emitters in any order, then one step from all of them, again and again."""

    def __init__(self, scan: Scan, index: int, start: State) -> None:
        super().__init__(scan, index, start)
        self._sizes = [len(part) for part in batches(problem(scan, index))]

    def first(self) -> list[Call]:
        # Without what only the step needs.
        image = self.state.slowness, self.state.sweep
        return [Call(look, (self._scan, self._index, *image, part)) for part in range(len(self._sizes))]

    def _next(self, call: Call, future: Future) -> list[Call]:
        if call.function is look:
            return self._gathered(call, future, self._sizes, step, self.state)
        self.state = self._stepped(future)
        return [] if self.state.done else self.first()


def advance(scan: Scan, index: int, state: sart.State, emitters: int) -> tuple[sart.State, float]:
    """Task: use more emitters of one slice; returns the new state and the seconds it took."""
    start = time.perf_counter()
    state = sart.advance(problem(scan, index), scan.settings, state, emitters, index)
    return state, time.perf_counter() - start


def look(scan: Scan, index: int, slowness: Floats, sweep: int, part: int) -> Rows:
    """Task: the rays of one batch of emitters through an image."""
    of = problem(scan, index)
    return gauss_newton.look(of, scan.settings, slowness, sweep, batches(of)[part])


def step(scan: Scan, index: int, state: gauss_newton.Iterate, rows: list[Rows]) -> gauss_newton.Iterate:
    """Task: the next image."""
    return gauss_newton.step(problem(scan, index), scan.settings, state, rows, index)


def look_losses(scan: Scan, index: int, slowness: Floats, part: int) -> Rows:
    """Task: as ``look`` for the amplitudes, through the finished image."""
    of = problem(scan, index)
    emitters = batches_of_losses(of, scan.settings)[part]
    return attenuation.look(of, scan.settings, slowness, emitters)


def attenuate(scan: Scan, index: int, rows: list[Rows]) -> Floats:
    """Task: the attenuation."""
    return attenuation.attenuation(problem(scan, index), scan.settings, rows)


def next_batch(batch: int, used: int, seconds: float) -> int:
    """Emitters that take about ``TASK_S``; a batch that ended with its sweep tells too little."""
    if used != batch or seconds <= 0.0:
        return batch
    return max(1, min(4 * batch, int(batch * TASK_S / seconds)))


@lru_cache(maxsize=8)
def problem(scan: Scan, index: int) -> SliceProblem:
    """One slice's problem, read once a process."""
    return problem_of(_dataset(scan.path, scan.stamp), scan.settings, index)


@lru_cache(maxsize=2)
def _dataset(path: Path, stamp: int) -> Dataset:
    return read_dataset(path, traces=False)

"""What is to be done for one slice, as tasks: one after the other for SART, side by side for Gauss–Newton."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from distributed import Future

from bentray_kernels.acquisition import Dataset
from bentray_kernels.arrays import Floats
from bentray_kernels.tomography import Settings, SliceProblem, gauss_newton, sart
from bentray_kernels.tomography.linearisation import Rows
from bentray_kernels.tomography.reconstruction import State, batches, problem_of

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


class Chain(Protocol):
    """The tasks of one slice.

    Attributes:
        state: where the slice stands.
        looked: emitters whose rays are traced, of an iteration that has not made its step.
    """

    state: State
    looked: int

    def first(self) -> list[Call]:
        """Tasks to begin with."""

    def after(self, call: Call, future: Future) -> list[Call]:
        """Tasks that may follow one that has finished; raises what that one raised."""


def chain(scan: Scan, index: int, start: State) -> Chain:
    """The chain of one slice, for the method that the settings ask for."""
    if isinstance(start, sart.State):
        return SartChain(scan, index, start)
    return GaussNewtonChain(scan, index, start)


class SartChain:
    """Batches of emitters, each used on the image that the one before left."""

    def __init__(self, scan: Scan, index: int, start: sart.State) -> None:
        self._scan, self._index, self._batch = scan, index, FIRST_BATCH
        self.state: State = start
        self.looked = 0

    def first(self) -> list[Call]:
        return [Call(advance, (self._scan, self._index, self.state, self._batch))]

    def after(self, call: Call, future: Future) -> list[Call]:
        used = -self.state.emitter
        self.state, seconds = future.result()
        self._batch = next_batch(self._batch, used + self.state.emitter, seconds)
        return [] if self.state.done else self.first()


class GaussNewtonChain:
    """The rays of all emitters in any order, then one step from all of them, again and again.

    The rows stay with the workers that made them until the step asks for them.
    """

    def __init__(self, scan: Scan, index: int, start: gauss_newton.Iterate) -> None:
        self._scan, self._index = scan, index
        self._sizes = [len(part) for part in batches(problem(scan, index))]
        self._rows: dict[int, Future] = {}
        self.state: State = start
        self.looked = 0

    def first(self) -> list[Call]:
        # Without what only the step needs.
        image = self.state.slowness, self.state.sweep
        return [Call(look, (self._scan, self._index, *image, part)) for part in range(len(self._sizes))]

    def after(self, call: Call, future: Future) -> list[Call]:
        if call.function is step:
            self.state, self._rows, self.looked = future.result(), {}, 0
            return [] if self.state.done else self.first()
        if future.status != "finished":
            future.result()
        part = call.arguments[-1]
        self._rows[part] = future
        self.looked += self._sizes[part]
        if len(self._rows) < len(self._sizes):
            return []
        return [Call(step, (self._scan, self._index, self.state, [f for _, f in sorted(self._rows.items())]))]


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

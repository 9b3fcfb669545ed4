"""Task graphs of one stage of a reconstruction: SART or Gauss-Newton on one grid."""

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays import Floats, Ints
from ..task_graph import Task
from .gauss_newton import gauss_newton_step
from .gauss_newton.linearisation import Rows
from .result import Iteration
from .sart import sart_step
from .sart.sart_slices import SliceCall, advance_slices
from .scan import Scan
from .solver_choice import sart_engine

# Long enough that scheduling costs nothing, short enough to show progress and to stop soon.
TASK_S = 0.5
# Nodes that the wave fronts of a first batch pass, in about a tenth of a second; later batches are timed.
FIRST_NODES = 2_000_000

# Emitters whose rays are traced in one task of Gauss-Newton, and after the last image.
BATCH = 16


class Stage(ABC):
    """Task graph of one stage.

    Attributes:
        number: from 0.
        state: of the iteration.
        final_rows: rays of each batch through the final image, where the iteration has traced them.
    """

    state: sart_step.State | gauss_newton_step.Iterate
    final_rows: Sequence[Any] = ()

    def __init__(self, scan: Scan, index: int, number: int) -> None:
        self._at = scan, index, number
        self.number = number
        self._emitters = len(scan.problem(index, number).active_emitters)
        self._most = self._emitters * scan.stages()[number].iterations

    @property
    def total(self) -> int:
        """Emitter passes: at most, and once the iteration has ended those that it made."""
        return self.done if self.state.done else self._most

    @property
    def done(self) -> int:
        """Emitter passes made."""
        return self._emitters * self.state.iteration + self.state.emitter

    @property
    def history(self) -> tuple[Iteration, ...]:
        """Iterations of this stage."""
        return tuple(replace(record, stage=self.number) for record in self.state.history)

    @abstractmethod
    def first(self) -> list[Task]: ...

    @abstractmethod
    def after(self, task: Task, result: Any) -> list[Task]: ...


class SartStage(Stage):
    """SART: batches of emitters, each updating the image of the batch before."""

    def __init__(self, scan: Scan, index: int, number: int, image: Floats) -> None:
        super().__init__(scan, index, number)
        self.state: sart_step.State = sart_step.begin(image)
        self._batch = max(1, FIRST_NODES // image.size)
        on_device = sart_engine(scan.stages()[number], image.ndim) == "opencl"
        self._together = update_sart_slices if on_device else None

    def first(self) -> list[Task]:
        arguments = (*self._at, self.state, self._batch)
        return [Task(update_sart, arguments, batch_function=self._together)]

    def after(self, task: Task, result: Any) -> list[Task]:
        before = self.state.emitter
        self.state, seconds = result
        self._batch = next_batch(self._batch, self.state.emitter - before, seconds)
        return [] if self.state.done else self.first()


class GaussNewtonStage(Stage):
    """Gauss-Newton: rays of all emitters in any order, then one update from all of them, repeatedly."""

    def __init__(self, scan: Scan, index: int, number: int, image: Floats) -> None:
        super().__init__(scan, index, number)
        self.state: gauss_newton_step.Iterate = gauss_newton_step.begin(image)
        self._sizes = [len(batch) for batch in batches_of(scan.problem(index, number).active_emitters)]
        self._rows: dict[int, Any] = {}

    @property
    def done(self) -> int:
        return super().done + (0 if self.state.done else sum(self._sizes[batch] for batch in self._rows))

    def first(self) -> list[Task]:
        # The image alone: tracing needs nothing else of the state.
        image = self.state.slowness
        return [
            Task(trace_rays, (*self._at, image, batch), keep_on_worker=True)
            for batch in range(len(self._sizes))
        ]

    def after(self, task: Task, result: Any) -> list[Task]:
        if task.function is trace_rays:
            self._rows[task.arguments[-1]] = result
            if len(self._rows) < len(self._sizes):
                return []
            # In the order of the emitters, not of completion: floating-point sums depend on it.
            rows = [rows for _, rows in sorted(self._rows.items())]
            return [Task(update_gauss_newton, (*self._at, self.state, rows))]
        if result.done and np.array_equal(result.slowness, self.state.slowness):
            self.final_rows = [rows for _, rows in sorted(self._rows.items())]
        self.state, self._rows = result, {}
        return [] if self.state.done else self.first()


def update_sart(
    scan: Scan, index: int, stage: int, state: sart_step.State, emitters: int
) -> tuple[sart_step.State, float]:
    """Task: update one slice with some more emitters; returns the new state and the seconds it took."""
    started = time.perf_counter()
    state = sart_step.advance(scan.problem(index, stage), scan.stages()[stage], state, emitters, index)
    return state, time.perf_counter() - started


def update_sart_slices(
    calls: list[tuple[Scan, int, int, sart_step.State, int]],
) -> list[tuple[sart_step.State, float]]:
    """Task: as ``update_sart`` for several slices at a time, on an OpenCL device where one passes."""
    started = time.perf_counter()
    states: dict[int, sart_step.State] = {}
    left = list(range(len(calls)))
    while left:
        scan, _, stage, _, _ = calls[left[0]]
        same = [k for k in left if calls[k][0] == scan and calls[k][2] == stage]
        left = [k for k in left if k not in same]
        problems = scan.problems(tuple(calls[k][1] for k in same), stage)
        slices = [
            SliceCall(problem, *calls[k][3:], calls[k][1]) for k, problem in zip(same, problems, strict=True)
        ]
        states |= zip(same, advance_slices(slices, scan.stages()[stage]), strict=True)
    seconds = time.perf_counter() - started
    return [(states[k], seconds) for k in range(len(calls))]


def trace_rays(scan: Scan, index: int, stage: int, slowness: Floats, batch: int) -> Rows:
    """Task: the rays of one batch of emitters through an image."""
    problem = scan.problem(index, stage)
    emitters = batches_of(problem.active_emitters)[batch]
    return gauss_newton_step.trace_rays(problem, scan.stages()[stage], slowness, emitters)


def update_gauss_newton(
    scan: Scan, index: int, stage: int, state: gauss_newton_step.Iterate, rows: list[Rows]
) -> gauss_newton_step.Iterate:
    """Task: the next image."""
    return gauss_newton_step.step(scan.problem(index, stage), scan.stages()[stage], state, rows, index)


def next_batch(batch: int, used: int, seconds: float) -> int:
    """Emitters that take about ``TASK_S``; unchanged after a batch cut short by the end of its iteration."""
    if used != batch or seconds <= 0.0:
        return batch
    return max(1, min(4 * batch, int(batch * TASK_S / seconds)))


def batches_of(emitters: Ints) -> list[Ints]:
    """``BATCH`` emitters at a time."""
    return [emitters[k : k + BATCH] for k in range(0, len(emitters), BATCH)]

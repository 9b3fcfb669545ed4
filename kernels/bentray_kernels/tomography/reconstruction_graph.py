"""Task graph of the reconstruction of one slice or volume."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from ..arrays import Flags, Floats, Ints
from ..errors import InvalidInput
from ..task_graph import ResumableGraph, Task
from . import attenuation, resolution
from .attenuation import Losses
from .finite_frequency import width_in_nodes
from .gauss_newton import gauss_newton_step
from .gauss_newton.gauss_newton_step import Iterate
from .gauss_newton.linearisation import Rows, ray_density
from .grid_schedule import initial_slowness
from .problem import Problem
from .result import Iteration, Progress
from .sart.sart_step import State
from .scan import Scan
from .stage_graphs import GaussNewtonStage, SartStage, Stage, batches_of, trace_rays
from .uncertainty.model_errors import ModelErrors
from .uncertainty.ray_uncertainty import Uncertainty, ray_uncertainty


class TomographyGraph(ResumableGraph, Protocol):
    """A resumable graph with a history of iterations: a reconstruction, or a refinement of its image."""

    @property
    def history(self) -> tuple[Iteration, ...]: ...


# Runs graphs to their end and reports progress. The numbers are the emitter passes made before, and those
# that may come after.
Run = Callable[[Sequence[TomographyGraph], int, int], None]


@dataclass(frozen=True)
class ReconstructionCheckpoint:
    """State of a ``ReconstructionGraph``; see ``task_graph.Checkpoint``.

    Attributes:
        stage: number of the stage in progress, from 0.
        passes_before: emitter passes of earlier stages.
        history: of earlier stages.
        state: of the stage in progress.
        values: result of each evaluation after the last stage; None if there is none yet.
        spacing: of the nodes of the stage, m.
        origin: position of node 0, m.
    """

    stage: int
    passes_before: int
    history: tuple[Iteration, ...]
    state: State | Iterate
    values: tuple[Floats | Losses | Uncertainty | None, ...]
    spacing: float
    origin: tuple[float, ...]

    @property
    def milestone(self) -> tuple[Any, ...]:
        finished = tuple(value is not None for value in self.values)
        return self.stage, self.state.iteration, self.state.done, finished


class ReconstructionGraph:
    """All stages of one slice, then its attenuation, resolution check and uncertainty where requested."""

    def __init__(self, scan: Scan, index: int) -> None:
        self._scan, self._index = scan, index
        self._plans = scan.stages()
        self._history: tuple[Iteration, ...] = ()
        self._passes_before = 0
        self._stage = self._stage_of(0, initial_slowness(scan.problem(index, 0), None))
        self._evaluations = self._evaluated()
        self._most = [
            len(scan.problem(index, number).active_emitters) * plan.iterations
            for number, plan in enumerate(self._plans)
        ]

    def _evaluated(self) -> list[Evaluation]:
        """Quantities computed along the rays of the finished image."""
        settings, problem = self._plans[-1], self._scan.problem(self._index)
        at = self._scan, self._index
        evaluations = []
        if settings.attenuation.enabled and problem.log_ratio is not None:
            emitters = attenuation.active_emitters(problem)
            evaluations.append(Evaluation(at, trace_attenuation_rays, solve_attenuation, emitters))
        if settings.resolution_check:
            emitters = problem.active_emitters
            evaluations.append(Evaluation(at, trace_final_rays, check_resolution, emitters, as_stage=True))
        if settings.estimates_uncertainty:
            emitters = problem.each_pair_once().active_emitters
            same = settings.rays == "curved" and settings.numerics.reciprocity
            evaluations.append(Evaluation(at, trace_uncertainty_rays, estimate_uncertainty, emitters, same))
        return evaluations

    @property
    def total(self) -> int:
        """Emitter passes, at most; without those that an early stop has saved."""
        later = sum(self._most[self._stage.number + 1 :])
        later += sum(sum(evaluation.sizes) for evaluation in self._evaluations)
        return self._passes_before + self._stage.total + later

    @property
    def done(self) -> int:
        """Emitter passes made."""
        evaluated = sum(evaluation.done for evaluation in self._evaluations)
        return self._passes_before + self._stage.done + evaluated

    @property
    def state(self) -> State | Iterate:
        """State of the stage in progress."""
        return self._stage.state

    def value_of(self, evaluate: Callable[..., Any]) -> Any:
        """Result of a task after the last stage; None before it, and where it is not requested."""
        return next(
            (evaluation.value for evaluation in self._evaluations if evaluation.evaluate is evaluate), None
        )

    @property
    def history(self) -> tuple[Iteration, ...]:
        """Iterations of all stages so far."""
        return self._history + self._stage.history

    @property
    def checkpoint(self) -> ReconstructionCheckpoint:
        """The state; without rows of an iteration that is not finished."""
        values = tuple(evaluation.value for evaluation in self._evaluations)
        number = self._stage.number
        problem = self._scan.problem(self._index, number)
        before = number, self._passes_before, self._history
        return ReconstructionCheckpoint(*before, self._stage.state, values, problem.spacing, problem.origin)

    def restore(self, checkpoint: ReconstructionCheckpoint) -> None:
        """See ``task_graph.ResumableGraph``."""
        self._history, self._passes_before = checkpoint.history, checkpoint.passes_before
        self._stage = self._stage_of(checkpoint.stage, checkpoint.state.slowness)
        self._stage.state = checkpoint.state
        for evaluation, value in zip(self._evaluations, checkpoint.values, strict=True):
            # Checkpoints of earlier versions hold the attenuation without its misfits: it is solved again.
            earlier = evaluation.evaluate is solve_attenuation and not isinstance(value, Losses)
            evaluation.value = None if earlier else value

    def first(self) -> list[Task]:
        """See ``task_graph.TaskGraph``."""
        return self._next() if self._stage.state.done else self._stage.first()

    def after(self, task: Task, result: Any) -> list[Task]:
        """See ``task_graph.TaskGraph``."""
        for evaluation in self._evaluations:
            if evaluation.owns(task):
                return evaluation.after(task, result)
        following = self._stage.after(task, result)
        return following if following or not self._stage.state.done else self._next()

    def _next(self) -> list[Task]:
        """Tasks that follow a finished stage."""
        image, number = self._stage.state.slowness, self._stage.number + 1
        if number == len(self._plans):
            pending = [evaluation for evaluation in self._evaluations if evaluation.value is None]
            rows, self._stage.final_rows = self._stage.final_rows, ()
            return [task for evaluation in pending for task in evaluation.first(image, rows)]
        self._history = self.history
        self._passes_before += self._stage.total
        earlier, problem = (self._scan.problem(self._index, k) for k in (number - 1, number))
        self._stage = self._stage_of(number, initial_slowness(problem, image, earlier))
        return self._stage.first()

    def _stage_of(self, number: int, image: Floats) -> Stage:
        kind = GaussNewtonStage if self._plans[number].method == "gauss-newton" else SartStage
        return kind(self._scan, self._index, number, image)


class Evaluation:
    """Rays of all emitters through the finished image, then one task that uses all of them.

    Args:
        at: the scan and the index of the slice.
        trace, evaluate: the functions of the two kinds of task.
        emitters: whose rays are used.
        as_stage: whether they are those that the last stage may have traced through its final image.

    Attributes:
        trace, evaluate: as above.
        sizes: emitters of each batch.
        value: result of ``evaluate``.
    """

    def __init__(
        self,
        at: tuple[Scan, int],
        trace: Callable[..., Rows],
        evaluate: Callable[..., Any],
        emitters: Ints,
        as_stage: bool = False,
    ) -> None:
        self._at, self.trace, self.evaluate, self._as_stage = at, trace, evaluate, as_stage
        self.sizes = [len(batch) for batch in batches_of(emitters)]
        self.value: Any = None
        self._image: Floats | None = None
        self._rows: dict[int, Any] = {}

    @property
    def done(self) -> int:
        """Emitters whose rays are traced."""
        return sum(self.sizes) if self.value is not None else sum(self.sizes[batch] for batch in self._rows)

    def owns(self, task: Task) -> bool:
        """Whether it is one of these tasks."""
        return task.function in (self.trace, self.evaluate) and task.arguments[0] == self._at[0]

    def first(self, image: Floats, rows: Sequence[Any] = ()) -> list[Task]:
        """Tasks to start with; the evaluation itself without emitters, or with the rows of all batches."""
        self._image, rays = image, list[Any]()
        if rows and self._as_stage:
            # Passes that are saved are not counted as made.
            self.sizes, rays = [], list(rows)
        if not self.sizes:
            return [Task(self.evaluate, (*self._at, image, rays))]
        return [
            Task(self.trace, (*self._at, image, batch), keep_on_worker=True)
            for batch in range(len(self.sizes))
        ]

    def after(self, task: Task, result: Any) -> list[Task]:
        """Keep the rows of one batch; with the last batch, the task that uses all of them."""
        if task.function is self.evaluate:
            self.value, self._rows = result, {}
            return []
        self._rows[task.arguments[-1]] = result
        if len(self._rows) < len(self.sizes):
            return []
        rows = [rows for _, rows in sorted(self._rows.items())]
        return [Task(self.evaluate, (*self._at, self._image, rows))]


def trace_attenuation_rays(scan: Scan, index: int, slowness: Floats, batch: int) -> Rows:
    """Task: rays of one batch of emitters with amplitudes, through the finished image."""
    problem = scan.problem(index)
    emitters = batches_of(attenuation.active_emitters(problem))[batch]
    return attenuation.trace_rays(problem, scan.stages()[-1], slowness, emitters)


def solve_attenuation(scan: Scan, index: int, slowness: Floats, rows: list[Rows]) -> Losses:
    """Task: the attenuation image, and what shows whether it is better than a constant."""
    problem, settings = scan.problem(index), scan.stages()[-1]
    image = attenuation.solve(problem, settings, rows)
    if not (rows and problem.region.any()):
        return Losses(image, np.zeros(3))
    density = ray_density(problem, rows)
    grid = problem.spacing, problem.water_speed
    guided = ModelErrors.from_misfit(1.0 / slowness, problem.region, density, 0.0, 0.0, *grid).guided
    parts = [_rays_of(scan._replace(part=part), index, problem) for part in ("shown", "views")]
    # Behind a caustic pairs have no ray.
    if not all(part.any() and part.size == sum(block.residual.size for block in rows) for part in parts):
        return Losses(image, np.zeros(3), guided)
    return Losses(image, attenuation.validate(problem, settings, rows, *parts), guided)


def _rays_of(part: Scan, index: int, whole: Problem) -> Flags:
    """(rays,), of all pairs with amplitudes: those of a part of the scan; empty without such a part."""
    try:
        ratio = part.problem(index).log_ratio
    except InvalidInput:
        ratio = None
    if ratio is None or whole.log_ratio is None:
        return np.empty(0, np.bool_)
    return np.asarray(np.isfinite(ratio)[np.isfinite(whole.log_ratio)])


def trace_final_rays(scan: Scan, index: int, slowness: Floats, batch: int) -> Rows:
    """Task: rays of one batch of emitters through the finished image."""
    return trace_rays(scan, index, -1, slowness, batch)


def check_resolution(scan: Scan, index: int, _slowness: Floats, rows: list[Rows]) -> Floats:
    """Task: how much of a checkerboard the rays recover."""
    problem = scan.problem(index)
    return resolution.recovery(problem, rows, width_in_nodes(problem, scan.stages()[-1]))


def trace_uncertainty_rays(scan: Scan, index: int, slowness: Floats, batch: int) -> Rows:
    """Task: bent rays of one batch of emitters through the finished image, each pair once."""
    problem = scan.problem(index).each_pair_once()
    emitters = batches_of(problem.active_emitters)[batch]
    # Where straight rays were used, the times along bent rays show what that neglects.
    settings = replace(scan.stages()[-1], rays="curved")
    return gauss_newton_step.trace_rays(problem, settings, slowness, emitters)


def estimate_uncertainty(scan: Scan, index: int, slowness: Floats, rows: list[Rows]) -> Uncertainty:
    """Task: standard deviation and resolution width of the finished image."""
    problem = scan.problem(index).each_pair_once()
    return ray_uncertainty(problem, scan.stages()[-1], slowness, rows, index)


def progress_of(graphs: Sequence[TomographyGraph], before: int = 0, after: int = 0) -> Progress:
    """Progress over all graphs and the emitter passes before and after them."""
    history = sorted((s for g in graphs for s in g.history), key=lambda s: (s.stage, s.sweep, s.slice))
    done, total = (before + sum(getattr(g, name) for g in graphs) for name in ("done", "total"))
    return Progress(done, total + after, tuple(history))

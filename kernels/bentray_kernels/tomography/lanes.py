"""SART of several slices, each advanced by the same number of emitters, in compiled passes (2-D)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput
from .emitter_pass import EmitterPass
from .problem import Problem
from .result import residual_counts
from .sart import State, _close_sweep, emitter_order, propagation_speed
from .settings import Settings


def advance_many(
    problems: Sequence[Problem],
    settings: Settings,
    states: Sequence[State],
    emitters: int,
    slice_indices: Sequence[int],
) -> list[State]:
    """As ``sart.advance`` for several slices, several times as fast.

    The wave front is that of ``eikonal.deviation``, whatever ``settings.eikonal`` says, and sums have 32
    bits. No slice's result depends on the others: lanes of slices would not fill vectors better than the
    nodes and rays of one slice do, so they go one after the other, in the same arrays.

    Args:
        problems: the slices, all of one shape.
        settings: as for ``sart.advance``.
        states: where each slice goes on.
        emitters: at most how many of each slice, rounded up to whole subsets.
        slice_indices: axial index of each slice.

    Returns:
        The new states. How the work is cut into calls, and which slices share one, changes no bit of them.

    Raises:
        InvalidInput: for volumes, slices of different shapes, or lengths that do not match.
    """
    if not len(problems) == len(states) == len(slice_indices):
        raise InvalidInput(
            "states", f"{len(states)} states, {len(slice_indices)} indices", f"{len(problems)}, as problems"
        )
    shapes = {problem.region.shape for problem in problems}
    if len(shapes) > 1 or any(len(shape) != 2 for shape in shapes):
        raise InvalidInput("problems", sorted(shapes), "slices of one shape")
    if not problems:
        return []
    receivers = max(problem.delta_tof.shape[1] for problem in problems)
    (shape,) = shapes
    work = EmitterPass.over((shape[0], shape[1]), receivers)
    return [
        state if state.done else _advance(problem, settings, state, emitters, index, work)
        for problem, state, index in zip(problems, states, slice_indices, strict=True)
    ]


def _advance(
    problem: Problem, settings: Settings, state: State, emitters: int, index: int, work: EmitterPass
) -> State:
    order = emitter_order(problem, settings.seed, index, state.sweep)
    fresh = state.emitter == 0
    slowness = np.ascontiguousarray(state.slowness).copy()
    coverage = np.zeros_like(slowness) if fresh else state.coverage.copy()
    residuals = []
    squares, count = state.squares, state.count
    end = min(state.emitter + -(-emitters // settings.subset) * settings.subset, len(order))
    low, high = settings.speed_bounds_mps
    relaxation = settings.relaxation * settings.relaxation_decay**state.sweep
    for first in range(state.emitter, end, settings.subset):
        left = np.concatenate(
            [
                _look(problem, settings, slowness, emitter, work, warm=state.sweep > 0)
                for emitter in order[first : min(first + settings.subset, end)]
            ]
        )
        work.update(
            slowness,
            coverage,
            problem.region,
            problem.spacing,
            relaxation,
            settings.smoothing_nodes,
            (1.0 / high, 1.0 / low),
        )
        squares += float((left * left).sum())
        count += left.size
        residuals.append(left)
    state = replace(
        state,
        slowness=slowness,
        coverage=coverage,
        emitter=end,
        squares=squares,
        count=count,
        residuals=residual_counts(np.concatenate(residuals)) + (0 if fresh else state.residuals),
    )
    return state if end < len(order) else _close_sweep(state, settings, index, len(order))


def _look(
    problem: Problem, settings: Settings, slowness: Floats, emitter: int, work: EmitterPass, *, warm: bool
) -> Floats:
    """One emitter's residuals, s; its corrections wait in ``work`` for the update."""
    measured = problem.delta_tof[emitter]
    heard = np.flatnonzero(np.isfinite(measured))
    source, receivers = problem.emitters[emitter], problem.receivers_of(emitter)[heard]
    away = receivers - source
    front: Floats | None = None
    if settings.rays == "curved":
        front = slowness
        if settings.speed_update != "fixed" or settings.front_smoothing_nodes > 0.0:
            front = 1.0 / propagation_speed(slowness, problem.region, settings, warm=warm)
    return work.look(
        slowness,
        front,
        problem.spacing,
        source,
        receivers,
        measured[heard] + np.sqrt((away * away).sum(axis=1)) / problem.water_speed,
        settings.huber_s or np.inf,
    )

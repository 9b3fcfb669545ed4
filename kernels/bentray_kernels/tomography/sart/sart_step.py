"""Eikonal-SART, one emitter at a time, as a pure step from state to state (chapter 6, equations 1 to 6)."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...arrays import Floats, Ints
from ..problem import Problem
from ..result import Iteration, residual_counts
from ..settings import Settings
from .sart_update import update_for


@dataclass(frozen=True)
class State:
    """State of SART; the result of a resumed run has the same bits.

    Attributes:
        slowness: of the region's shape, s/m.
        coverage: as ``slowness``, metres of ray in the current iteration.
        iteration: finished iterations.
        emitter: emitters done in the current iteration.
        squares, count: sum of squared residuals, s², and their number, in the current iteration.
        residuals: histogram over ``RESIDUAL_EDGES_S``.
        done: whether all iterations are finished.
        history: a record per finished iteration.
    """

    slowness: Floats
    coverage: Floats
    iteration: int = 0
    emitter: int = 0
    squares: float = 0.0
    count: int = 0
    residuals: Ints = field(default_factory=lambda: residual_counts(np.empty(0)))
    done: bool = False
    history: tuple[Iteration, ...] = ()


@dataclass(frozen=True)
class BlockCheckpoint:
    """State of SART in blocks, whose images are in files; see ``task_graph.Checkpoint``.

    Attributes:
        state: of SART, with empty images: those are in files.
        updates: made so far; the number of the files.
        blocks: number of blocks.
        nodes: along x.
        spacing: of the nodes, m.
        origin: position of node 0, m.
    """

    state: State
    updates: int
    blocks: int
    nodes: int
    spacing: float
    origin: tuple[float, ...]

    @property
    def milestone(self) -> tuple[Any, ...]:
        # Each update: its files replace those of the update before the last.
        return (self.updates,)


def begin(slowness: Floats) -> State:
    """The state that begins with an image, of the region's shape, s/m."""
    return State(slowness, np.zeros_like(slowness))


def advance(problem: Problem, settings: Settings, state: State, emitters: int, slice_index: int = 0) -> State:
    """Update the image by up to ``emitters`` more emitters, at most to the end of the current iteration.

    For each emitter in random order: the travel time through the current image, the rays along its gradient,
    the slowness integral along each, and one simultaneous update of all nodes from the residuals of
    ``settings.numerics.subset`` emitters (of one in chapter 6). The bits of the result do not depend on how
    the emitters are distributed over calls.

    Args:
        problem: the slice or volume.
        settings: the settings; the emitter order depends on the seed, the slice and the iteration.
        state: the state to continue from.
        emitters: largest number, rounded up to whole subsets.
        slice_index: axial index, for the order and the history.

    Returns:
        The new state.
    """
    if state.done:
        return state
    batch = batch_of(problem, settings, state, emitters, slice_index)
    slowness = np.array(state.slowness, dtype=np.float64, order="C")
    coverage = np.zeros_like(slowness) if state.emitter == 0 else state.coverage.copy()
    size = settings.numerics.subset
    squares, residuals = state.squares, []
    update = update_for(problem, settings)
    for first in range(0, len(batch), size):
        residual = update(slowness, coverage, batch[first : first + size], state.iteration)
        residuals.append(residual)
        squares += float((residual * residual).sum())
    counts = residual_counts(np.concatenate(residuals))
    images = slowness, coverage
    return advanced(problem, settings, state, len(batch), images, squares, counts, slice_index)


def batch_of(problem: Problem, settings: Settings, state: State, emitters: int, slice_index: int = 0) -> Ints:
    """The next emitters of the current iteration, in order; see ``advance``."""
    order = emitter_order(problem, settings.numerics.seed, slice_index, state.iteration)
    size = settings.numerics.subset
    return order[state.emitter : state.emitter + -(-emitters // size) * size]


def advanced(
    problem: Problem,
    settings: Settings,
    state: State,
    emitters: int,
    images: tuple[Floats, Floats],
    squares: float,
    counts: Ints,
    slice_index: int = 0,
) -> State:
    """The state after the updates by some emitters.

    Args:
        problem, settings, state: as ``advance``.
        emitters: their number.
        images: slowness and coverage after the updates.
        squares: sum of squared residuals so far in this iteration, s².
        counts: histogram of the residuals of these emitters.
        slice_index: for the history.
    """
    slowness, coverage = images
    first_batch, number = state.emitter == 0, len(problem.active_emitters)
    state = replace(
        state,
        slowness=slowness,
        coverage=coverage,
        emitter=state.emitter + emitters,
        squares=squares,
        # Each residual is in one of the bins.
        count=state.count + int(counts.sum()),
        residuals=counts if first_batch else state.residuals + counts,
    )
    return state if state.emitter < number else _finish_iteration(state, settings, slice_index, number)


def emitter_order(problem: Problem, seed: int, slice_index: int, iteration: int) -> Ints:
    """Emitters with data, in the random order of one iteration; the same on every worker."""
    return np.random.default_rng((seed, slice_index, iteration)).permutation(problem.active_emitters)


def _finish_iteration(state: State, settings: Settings, slice_index: int, emitters: int) -> State:
    rms = math.sqrt(state.squares / state.count)
    number = state.iteration + 1
    return replace(
        state,
        iteration=number,
        emitter=0,
        squares=0.0,
        count=0,
        done=number >= settings.iterations or settings.numerics.residual_within_noise(rms),
        history=(*state.history, Iteration(slice_index, number, rms, emitters)),
    )

"""Eikonal-SART, one emitter at a time, as a pure step from state to state (chapter 6, equations 1 to 6)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

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
        coverage: as ``slowness``, metres of ray in the sweep under way.
        sweep: passes finished.
        emitter: emitters done in the pass under way.
        squares, count: sum of squared residuals, s², and their number, in the pass under way.
        residuals: how many of them fall between two of ``RESIDUAL_EDGES_S``.
        done: whether all iterations are finished.
        history: a record per finished pass.
    """

    slowness: Floats
    coverage: Floats
    sweep: int = 0
    emitter: int = 0
    squares: float = 0.0
    count: int = 0
    residuals: Ints = field(default_factory=lambda: residual_counts(np.empty(0)))
    done: bool = False
    history: tuple[Iteration, ...] = ()


def begin(slowness: Floats) -> State:
    """An image to begin with, of the region's shape, s/m."""
    return State(slowness, np.zeros_like(slowness))


def advance(problem: Problem, settings: Settings, state: State, emitters: int, slice_index: int = 0) -> State:
    """Use up to ``emitters`` more emitters, ending at the latest with the pass under way.

    For each emitter in random order: the travel time through the current image, the rays down it, the
    slowness integral along each, and one simultaneous update of all nodes from the residuals of
    ``settings.numerics.subset`` emitters (of one in chapter 6). How the work is cut into calls does not
    change a bit of the result.

    Args:
        problem: the slice or volume.
        settings: the settings; the emitter order depends on the seed, the slice and the pass.
        state: where to go on.
        emitters: at most how many, rounded up to whole subsets.
        slice_index: axial index, for the order and the history.

    Returns:
        The new state.
    """
    if state.done:
        return state
    order = emitter_order(problem, settings.seed, slice_index, state.sweep)
    fresh = state.emitter == 0
    slowness = np.array(state.slowness, dtype=np.float64, order="C")
    coverage = np.zeros_like(slowness) if fresh else state.coverage.copy()
    end = min(state.emitter + -(-emitters // settings.numerics.subset) * settings.numerics.subset, len(order))
    squares, left = state.squares, []
    use = update_for(problem, settings)
    for first in range(state.emitter, end, settings.numerics.subset):
        subset = order[first : min(first + settings.numerics.subset, end)]
        left.append(use(problem, settings, slowness, coverage, subset, state.sweep))
        squares += float((left[-1] * left[-1]).sum())
    counts = residual_counts(np.concatenate(left))
    state = replace(
        state,
        slowness=slowness,
        coverage=coverage,
        emitter=end,
        squares=squares,
        count=state.count + sum(part.size for part in left),
        residuals=counts if fresh else state.residuals + counts,
    )
    return state if end < len(order) else _close_sweep(state, settings, slice_index, len(order))


def emitter_order(problem: Problem, seed: int, slice_index: int, sweep: int) -> Ints:
    """Emitters with data, in the random order of one pass; the same for every worker and every resume."""
    return np.random.default_rng((seed, slice_index, sweep)).permutation(problem.active_emitters)


def _close_sweep(state: State, settings: Settings, slice_index: int, emitters: int) -> State:
    rms = math.sqrt(state.squares / state.count)
    sweep = state.sweep + 1
    return replace(
        state,
        sweep=sweep,
        emitter=0,
        squares=0.0,
        count=0,
        done=sweep >= settings.iterations or settings.numerics.explained(rms),
        history=(*state.history, Iteration(slice_index, sweep, rms, emitters)),
    )

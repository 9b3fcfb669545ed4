"""Eikonal-SART, one emitter at a time, as a pure step from state to state (chapter 6, equations 1 to 6)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter

from ..arrays import Flags, Floats, Ints
from ..compiled import kernel
from ..eikonal import solve
from ..rays.descent import PARTS, STEP, curved_ray, straight_ray, walk
from ..rays.fan import Fan
from .problem import SliceProblem
from .result import Sweep
from .settings import Settings


@dataclass(frozen=True)
class State:
    """Where a reconstruction stands; all that is needed to go on, to the bit.

    Attributes:
        slowness: (nodes, nodes), s/m.
        coverage: (nodes, nodes), metres of ray in the sweep under way.
        sweep: passes finished.
        emitter: emitters done in the pass under way.
        squares, count: sum of squared residuals, s², and their number, in the pass under way.
        done: whether nothing is left to do.
        history: a record per finished pass.
        attenuation: (nodes, nodes), Np/m, once it is known; see ``attenuation``.
    """

    slowness: Floats
    coverage: Floats
    sweep: int = 0
    emitter: int = 0
    squares: float = 0.0
    count: int = 0
    done: bool = False
    history: tuple[Sweep, ...] = ()
    attenuation: Floats | None = None


def begin(problem: SliceProblem) -> State:
    """Water everywhere."""
    shape = problem.region.shape
    return State(np.full(shape, 1.0 / problem.water_speed), np.zeros(shape))


def advance(
    problem: SliceProblem, settings: Settings, state: State, emitters: int, slice_index: int = 0
) -> State:
    """Use up to ``emitters`` more emitters, ending at the latest with the pass under way.

    For each emitter in random order: the travel time through the current image, the rays down it, the
    slowness integral along each, and one simultaneous update of all nodes from the residuals. How the work
    is cut into calls does not change a bit of the result.

    Args:
        problem: the slice.
        settings: the settings; the emitter order depends on the seed, the slice and the pass.
        state: where to go on.
        emitters: at most how many.
        slice_index: axial index, for the order and the history.

    Returns:
        The new state.
    """
    if state.done:
        return state
    order = emitter_order(problem, settings.seed, slice_index, state.sweep)
    slowness = state.slowness.copy()
    coverage = np.zeros_like(slowness) if state.emitter == 0 else state.coverage.copy()
    squares, count = state.squares, state.count
    batch = order[state.emitter : state.emitter + emitters]
    for emitter in batch:
        more, pairs = _use(problem, settings, slowness, coverage, int(emitter), warm=state.sweep > 0)
        squares += more
        count += pairs
    state = replace(
        state,
        slowness=slowness,
        coverage=coverage,
        emitter=state.emitter + len(batch),
        squares=squares,
        count=count,
    )
    return state if state.emitter < len(order) else _close_sweep(state, settings, slice_index, len(order))


def emitter_order(problem: SliceProblem, seed: int, slice_index: int, sweep: int) -> Ints:
    """Emitters with data, in the random order of one pass; the same for every worker and every resume."""
    with_data = np.flatnonzero(np.isfinite(problem.delta_tof).any(axis=1))
    return np.random.default_rng((seed, slice_index, sweep)).permutation(with_data)


def propagation_speed(slowness: Floats, region: Flags, settings: Settings, *, warm: bool) -> Floats:
    """The speed F that the wave front runs in (chapter 6, equations 5 and 6, with k = 1).

    ``fixed`` is the image itself. ``data-driven`` stretches the image's own range to the range that the
    object is known to have, so that shapes bend the rays in full before the values have grown; until one
    pass has made a shape (``warm``) there is nothing to stretch.
    """
    speed = np.asarray(1.0 / slowness)
    if settings.speed_update == "fixed" or settings.speed_range_mps is None or not warm:
        return speed
    low, high = settings.speed_range_mps
    inside = speed[region]
    least, most = float(inside.min()), float(inside.max())
    if most - least <= 0.0:
        return speed
    speed[region] = low + (inside - least) / (most - least) * (high - low)
    return speed


def _close_sweep(state: State, settings: Settings, slice_index: int, emitters: int) -> State:
    rms = math.sqrt(state.squares / state.count)
    sweep = state.sweep + 1
    return replace(
        state,
        sweep=sweep,
        emitter=0,
        squares=0.0,
        count=0,
        done=sweep >= settings.sweeps or rms <= settings.stop_rms_s,
        history=(*state.history, Sweep(slice_index, sweep, rms, emitters)),
    )


def _use(
    problem: SliceProblem, settings: Settings, slowness: Floats, coverage: Floats, emitter: int, *, warm: bool
) -> tuple[float, int]:
    """One SART update in place; returns the sum of squared residuals and their number."""
    measured = problem.delta_tof[emitter]
    heard = np.flatnonzero(np.isfinite(measured))
    source = problem.emitters[emitter]
    receivers = problem.receivers[heard]
    water = np.linalg.norm(receivers - source, axis=1) / problem.water_speed
    if settings.rays == "curved":
        speed = propagation_speed(slowness, problem.region, settings, warm=warm)
        tof = solve(speed, problem.spacing, source, settings.eikonal)
    else:
        tof = slowness  # only the shape counts: straight rays need no travel time
    fan = Fan.checked(tof, problem.spacing, receivers, source, settings.rays)
    corrections, weights, squares = _back_project(
        fan.receivers,
        fan.source,
        fan.tof,
        fan.gradient,
        fan.shape,
        fan.strides,
        fan.curved,
        fan.room,
        slowness.ravel() * problem.spacing,
        measured[heard] + water,
    )
    seen = weights > 0.0
    flat = np.zeros(slowness.size)
    flat[seen] = corrections[seen] / (weights[seen] * problem.spacing)
    update = flat.reshape(slowness.shape)
    update[~problem.region] = 0.0
    if settings.smoothing_nodes > 0.0:
        update = gaussian_filter(update, settings.smoothing_nodes, mode="nearest")
    low, high = settings.speed_bounds_mps
    moved = slowness + settings.relaxation * update
    slowness[problem.region] = np.clip(moved, 1.0 / high, 1.0 / low)[problem.region]
    coverage += weights.reshape(slowness.shape) * problem.spacing
    return squares, len(heard)


@kernel
def _back_project(
    receivers: Floats,
    source: Floats,
    tof: Floats,
    gradient: Floats,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    curved: bool,
    room: int,
    crossing: Floats,
    measured: Floats,
) -> tuple[Floats, Floats, float]:
    """Sums of equation 1 over the rays of one emitter.

    Args:
        crossing: slowness times spacing, flat, s per node.
        measured: (k,), travel times, s.

    Returns:
        Σ c·w (s), Σ w (nodes of ray), both flat over the nodes, and Σ (measured − predicted)², s².
    """
    axes = len(shape)
    path = np.empty((room, axes))
    scratch = np.empty((3, axes))
    nodes = np.empty((PARTS * room) << axes, np.int64)
    lengths = np.empty((PARTS * room) << axes)
    corrections = np.zeros(tof.size)
    weights = np.zeros(tof.size)
    squares = 0.0
    for row in range(len(receivers)):
        if curved:
            count = curved_ray(receivers[row], source, tof, gradient, shape, strides, STEP, path, scratch)
        else:
            count = straight_ray(receivers[row], source, axes, path)
        entries = walk(path, count, shape, strides, PARTS, nodes, lengths, scratch)
        predicted = 0.0
        length = 0.0
        for k in range(entries):
            predicted += lengths[k] * crossing[nodes[k]]
            length += lengths[k]
        residual = measured[row] - predicted
        squares += residual * residual
        if length == 0.0:
            continue
        correction = residual / length
        for k in range(entries):
            corrections[nodes[k]] += correction * lengths[k]
            weights[nodes[k]] += lengths[k]
    return corrections, weights, squares

"""Eikonal-SART, one emitter at a time, as a pure step from state to state (chapter 6, equations 1 to 6)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import gaussian_filter

from ..arrays import Flags, Floats, Ints
from ..compiled import kernel
from ..eikonal import solve
from ..rays.descent import PARTS, STEP, curved_ray, straight_ray, walk
from ..rays.fan import Fan
from .problem import Problem
from .result import Sweep, residual_counts
from .settings import Settings


@dataclass(frozen=True)
class State:
    """Where a reconstruction stands; all that is needed to go on, to the bit.

    Attributes:
        slowness: of the region's shape, s/m.
        coverage: as ``slowness``, metres of ray in the sweep under way.
        sweep: passes finished.
        emitter: emitters done in the pass under way.
        squares, count: sum of squared residuals, s², and their number, in the pass under way.
        residuals: how many of them fall between two of ``RESIDUAL_EDGES_S``.
        done: whether nothing is left to do.
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
    history: tuple[Sweep, ...] = ()


def begin(slowness: Floats) -> State:
    """An image to begin with, of the region's shape, s/m."""
    return State(slowness, np.zeros_like(slowness))


def advance(problem: Problem, settings: Settings, state: State, emitters: int, slice_index: int = 0) -> State:
    """Use up to ``emitters`` more emitters, ending at the latest with the pass under way.

    For each emitter in random order: the travel time through the current image, the rays down it, the
    slowness integral along each, and one simultaneous update of all nodes from the residuals of
    ``settings.subset`` emitters (of one in chapter 6). How the work is cut into calls does not change a bit
    of the result.

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
    slowness = state.slowness.copy()
    fresh = state.emitter == 0
    coverage = np.zeros_like(slowness) if fresh else state.coverage.copy()
    residuals = np.zeros_like(state.residuals) if fresh else state.residuals
    end = min(state.emitter + -(-emitters // settings.subset) * settings.subset, len(order))
    squares, count = state.squares, state.count
    for first in range(state.emitter, end, settings.subset):
        left = _use(
            problem,
            settings,
            slowness,
            coverage,
            order[first : min(first + settings.subset, end)],
            sweep=state.sweep,
        )
        squares += float((left * left).sum())
        count += left.size
        residuals = residuals + residual_counts(left)
    state = replace(
        state,
        slowness=slowness,
        coverage=coverage,
        emitter=end,
        squares=squares,
        count=count,
        residuals=residuals,
    )
    return state if end < len(order) else _close_sweep(state, settings, slice_index, len(order))


def emitter_order(problem: Problem, seed: int, slice_index: int, sweep: int) -> Ints:
    """Emitters with data, in the random order of one pass; the same for every worker and every resume."""
    return np.random.default_rng((seed, slice_index, sweep)).permutation(problem.sounding)


def propagation_speed(slowness: Floats, region: Flags, settings: Settings, *, warm: bool) -> Floats:
    """The speed F that the wave front runs in (chapter 6, equations 5 and 6, with k = 1).

    ``fixed`` is the image itself. ``data-driven`` stretches the image's own range to the range that the
    object is known to have, so that shapes bend the rays in full before the values have grown; until one
    pass has made a shape (``warm``) there is nothing to stretch.
    """
    speed = smoothed(1.0 / slowness, settings.front_smoothing_nodes)
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


def smoothed(speed: Floats, nodes: float) -> Floats:
    """The speed as a wave front of finite width meets it: under a Gaussian of that standard deviation.

    A wave does not feel what is narrower than its Fresnel zone; a ray follows every edge.
    """
    return np.asarray(gaussian_filter(speed, nodes, mode="nearest") if nodes > 0.0 else speed)


def _use(
    problem: Problem,
    settings: Settings,
    slowness: Floats,
    coverage: Floats,
    emitters: Ints,
    *,
    sweep: int,
) -> Floats:
    """One SART update in place, from some emitters; returns their residuals, s."""
    corrections, weights = np.zeros_like(slowness), np.zeros_like(slowness)
    residuals = []
    for emitter in emitters:
        slab = problem.slab(int(emitter))
        measured = problem.delta_tof[emitter]
        heard = np.flatnonzero(np.isfinite(measured))
        foot = np.zeros(slowness.ndim)
        foot[-1] = slab.start * problem.spacing
        source = problem.emitters[emitter] - foot
        receivers = problem.receivers_of(int(emitter))[heard] - foot
        water = np.linalg.norm(receivers - source, axis=1) / problem.water_speed
        inside = np.ascontiguousarray(slowness[..., slab])
        if settings.rays == "curved":
            speed = propagation_speed(inside, problem.region[..., slab], settings, warm=sweep > 0)
            tof = solve(speed, problem.spacing, source, settings.eikonal)
        else:
            tof = inside  # only the shape counts: straight rays need no travel time
        fan = Fan.checked(tof, problem.spacing, receivers, source, settings.rays)
        more, passed, left = _back_project(
            fan.receivers,
            fan.source,
            fan.tof,
            fan.gradient,
            fan.shape,
            fan.strides,
            fan.curved,
            fan.room,
            inside.ravel() * problem.spacing,
            measured[heard] + water,
            settings.huber_s or math.inf,
        )
        corrections[..., slab] += more.reshape(inside.shape)
        weights[..., slab] += passed.reshape(inside.shape)
        residuals.append(left)
    seen = weights > 0.0
    update = np.zeros_like(slowness)
    update[seen] = corrections[seen] / (weights[seen] * problem.spacing)
    update[~problem.region] = 0.0
    if settings.smoothing_nodes > 0.0:
        update = gaussian_filter(update, settings.smoothing_nodes, mode="nearest")
    low, high = settings.speed_bounds_mps
    moved = slowness + settings.relaxation * settings.relaxation_decay**sweep * update
    slowness[problem.region] = np.clip(moved, 1.0 / high, 1.0 / low)[problem.region]
    coverage += weights * problem.spacing
    return np.concatenate(residuals)


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
    huber: float,
) -> tuple[Floats, Floats, Floats]:
    """Sums of equation 1 over the rays of one emitter.

    Args:
        crossing: slowness times spacing, flat, s per node.
        measured: (k,), travel times, s.
        huber: a residual corrects by no more than this, s.

    Returns:
        Σ c·w (s), Σ w (nodes of ray), both flat over the nodes, and measured − predicted, s.
    """
    axes = len(shape)
    path = np.empty((room, axes))
    scratch = np.empty((3, axes))
    nodes = np.empty((PARTS * room) << axes, np.int64)
    lengths = np.empty((PARTS * room) << axes)
    corrections = np.zeros(tof.size)
    weights = np.zeros(tof.size)
    residuals = np.empty(len(receivers))
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
        residuals[row] = residual
        if length == 0.0:
            continue
        correction = min(max(residual, -huber), huber) / length
        for k in range(entries):
            corrections[nodes[k]] += correction * lengths[k]
            weights[nodes[k]] += lengths[k]
    return corrections, weights, residuals

"""One SART update of an image from some emitters: one compiled pass for slices, single rays otherwise."""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter

from ...arrays import Flags, Floats, Ints
from ...compilation.compiled import kernel
from ...eikonal import solve
from ...rays.descent import PARTS, STEP, empty_path, list_entries, trace_ray
from ...rays.fan import Fan
from ..problem import Problem
from ..settings import Settings
from ..solver_choice import solver_of
from .emitter_pass import TRUNCATE, EmitterPass

# One update of slowness and coverage in place from some emitters; returns their residuals, s. The last
# argument is the number of finished iterations.
Update = Callable[[Floats, Floats, Ints, int], Floats]


def update_for(problem: Problem, settings: Settings) -> Update:
    """The update for a problem: compiled where the settings allow it."""
    if solver_of(settings, problem.region.ndim).compiled:
        return _compiled(problem, settings)
    return partial(_traced, problem, settings)


def propagation_speed(slowness: Floats, region: Flags, settings: Settings, *, warm: bool) -> Floats:
    """The speed F of the wave front (chapter 6, equations 5 and 6, with k = 1).

    Without ``settings.numerics.speed_range_mps`` it is the image itself. With it the range of the image is
    stretched to this range of the object (data-driven speed), so that rays bend fully before the contrast of
    the image has grown; not in the first iteration, before which there is no contrast (``warm``).
    """
    speed = 1.0 / slowness
    if settings.numerics.speed_range_mps is None or not warm:
        return speed
    low, high = settings.numerics.speed_range_mps
    inside = speed[region]
    if not inside.size:
        return speed
    least, most = float(inside.min()), float(inside.max())
    if most - least <= 0.0:
        return speed
    speed[region] = low + (inside - least) / (most - least) * (high - low)
    return speed


def _compiled(problem: Problem, settings: Settings) -> Update:
    """The update ``_traced`` for a slice, several times as fast: see ``EmitterPass``."""
    rows, columns = problem.region.shape
    work = EmitterPass.for_grid((rows, columns), problem.delta_tof.shape[1])

    def update(slowness: Floats, coverage: Floats, emitters: Ints, iteration: int) -> Floats:
        residuals = []
        for emitter in emitters:
            source, receivers, measured = valid_receivers(problem, int(emitter))
            front = None
            if settings.rays == "curved":
                front = slowness
                if settings.numerics.speed_range_mps is not None:
                    front = 1.0 / propagation_speed(slowness, problem.region, settings, warm=iteration > 0)
            residuals.append(work.trace(slowness, front, problem.spacing, source, receivers, measured))
        work.update(
            slowness,
            coverage,
            problem.region,
            problem.spacing,
            settings.numerics.relaxation,
            settings.numerics.smoothing_nodes,
            bounds_of(settings),
        )
        return np.concatenate(residuals)

    return update


def _traced(
    problem: Problem, settings: Settings, slowness: Floats, coverage: Floats, emitters: Ints, iteration: int
) -> Floats:
    """See ``Update``."""
    corrections, weights = np.zeros_like(slowness), np.zeros_like(slowness)
    residuals = []
    for emitter in emitters:
        source, receivers, measured = valid_receivers(problem, int(emitter))
        tof = slowness  # only the shape counts: straight rays need no travel time
        if settings.rays != "straight":
            speed = propagation_speed(slowness, problem.region, settings, warm=iteration > 0)
            tof = solve(speed, problem.spacing, source, settings.ray_eikonal)
        gradient = settings.numerics.ray_gradient
        fan = Fan.checked(tof, problem.spacing, receivers, source, settings.rays, gradient)
        correction, weight, residual = _back_project(fan, slowness.ravel() * problem.spacing, measured)
        corrections += correction.reshape(slowness.shape)
        weights += weight.reshape(slowness.shape)
        residuals.append(residual)
    update = smoothed_update(corrections, weights, problem.region, problem.spacing, settings)
    apply_update(slowness, update, problem.region, settings)
    coverage += weights * problem.spacing
    return np.concatenate(residuals)


def smoothed_update(
    corrections: Floats, weights: Floats, region: Flags, spacing: float, settings: Settings
) -> Floats:
    """The update of each node before relaxation, s/m (chapter 6, equation 1).

    Args:
        corrections, weights: Σ c·w (s) and Σ w (nodes of ray) of each node.
        region: as these, nodes that may change.
        spacing: m.
        settings: ``numerics.smoothing_nodes``.
    """
    seen = weights > 0.0
    update = np.zeros_like(corrections)
    update[seen] = corrections[seen] / (weights[seen] * spacing)
    update[~region] = 0.0
    if settings.numerics.smoothing_nodes > 0.0:
        deviation = settings.numerics.smoothing_nodes
        update = np.asarray(gaussian_filter(update, deviation, mode="nearest", truncate=TRUNCATE))
    return update


def smoothing_reach(settings: Settings) -> int:
    """Nodes on either side of a node that the Gaussian of its update reads."""
    return int(TRUNCATE * settings.numerics.smoothing_nodes + 0.5)


def apply_update(slowness: Floats, update: Floats, region: Flags, settings: Settings) -> None:
    """Change the slowness in place, within its bounds; the arguments are as of ``smoothed_update``."""
    updated = slowness + settings.numerics.relaxation * update
    slowness[region] = np.clip(updated, *bounds_of(settings))[region]


def valid_receivers(problem: Problem, emitter: int) -> tuple[Floats, Floats, Floats]:
    """An emitter and its receivers, m, and the times measured, s."""
    delta = problem.delta_tof[emitter]
    valid = np.flatnonzero(np.isfinite(delta))
    source, receivers = problem.emitters[emitter], problem.receivers_of(emitter)[valid]
    offset = receivers - source
    measured = delta[valid] + np.sqrt((offset * offset).sum(axis=1)) / problem.water_speed
    return source, receivers, measured


def bounds_of(settings: Settings) -> tuple[float, float]:
    """Lowest and highest slowness, s/m."""
    low, high = settings.speed_bounds_mps
    return 1.0 / high, 1.0 / low


@kernel
def _back_project(fan: Fan, crossing: Floats, measured: Floats) -> tuple[Floats, Floats, Floats]:
    """Sums of equation 1 over the rays of one emitter.

    Args:
        crossing: slowness times spacing, flat, s per node.
        measured: (k,), travel times, s.

    Returns:
        Σ c·w (s), Σ w (nodes of ray), both flat over the nodes, and measured − predicted, s.
    """
    path, scratch = empty_path(fan)
    nodes = np.empty((PARTS * len(path)) << len(fan.shape), np.int64)
    lengths = np.empty(nodes.size)
    corrections = np.zeros(fan.tof.size)
    weights = np.zeros(fan.tof.size)
    residuals = np.empty(len(measured))
    for row in range(len(measured)):
        count = trace_ray(fan, row, STEP, path, scratch)
        entries = list_entries(fan, path, count, PARTS, nodes, lengths, scratch)
        predicted = 0.0
        length = 0.0
        for k in range(entries):
            predicted += lengths[k] * crossing[nodes[k]]
            length += lengths[k]
        residual = measured[row] - predicted
        residuals[row] = residual
        if length == 0.0:
            continue
        correction = residual / length
        for k in range(entries):
            corrections[nodes[k]] += correction * lengths[k]
            weights[nodes[k]] += lengths[k]
    return corrections, weights, residuals

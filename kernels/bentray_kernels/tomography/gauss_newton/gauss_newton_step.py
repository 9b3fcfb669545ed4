"""Gauss–Newton with bent rays: all emitters at once, then one linear problem with total variation.

Unlike SART, where every emitter waits for the image of the one before, the emitters of an iteration are
independent: a slice can use as many workers as it has emitters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Floats, Ints
from ...rays.fan import RayKind
from ..finite_frequency import front_smoothing, ray_slowness, width_in_nodes
from ..problem import Problem
from ..result import Iteration, residual_counts
from ..settings import Settings
from . import huber
from .linear_problem import Linearised
from .linearisation import Rows, linearise, ray_density

# A misfit above this part of the best before is no gain, and so many images in a row without one end the
# iteration; one does not: the first of bent rays may miss as much as straight ones do, and the next far less.
LEAST_GAIN = 0.98
PATIENCE = 2

# A step that makes the misfit grow is halved so often at most: the linearisation holds only near the image.
MOST_HALVINGS = 3


@dataclass(frozen=True)
class Measured:
    """An image that has been measured.

    Attributes:
        slowness: of the region's shape, s/m.
        sweep: the pass that measured it, from 1; 0 for none.
        limit: Huber's, s, for its residuals.
        loss: of its residuals, s; see ``gauss_newton.huber.loss``.
        residuals: how many of them fall between two of ``RESIDUAL_EDGES_S``.
    """

    slowness: Floats
    sweep: int
    limit: float
    loss: float
    residuals: Ints


@dataclass(frozen=True)
class Iterate:
    """State of the iteration; the result of a resumed run has the same bits.

    Attributes:
        slowness: of the region's shape, s/m.
        begun: the image that the iteration began with.
        dual: (ndim, ...), s, of the last linear problem.
        coverage: as ``slowness``, metres of ray through each node.
        best: the best image so far: each is compared with the best before it, at the limit of that one.
        halvings: of the last step.
        idle: images in a row, up to the last, that gained nothing.
        done: whether the iteration has ended.
        history: a record per iteration, of the misfit that it began with.
    """

    slowness: Floats
    begun: Floats
    dual: Floats
    coverage: Floats
    best: Measured
    halvings: int = 0
    idle: int = 0
    done: bool = False
    history: tuple[Iteration, ...] = ()

    @property
    def sweep(self) -> int:
        """Iterations finished."""
        return len(self.history)

    @property
    def emitter(self) -> int:
        """Emitters done in the iteration under way: none, for an iteration is one step."""
        return 0

    @property
    def residuals(self) -> Ints:
        """Of the best image; see ``Measured``."""
        return self.best.residuals


def begin(slowness: Floats) -> Iterate:
    """An image to begin with, of the region's shape, s/m."""
    best = Measured(slowness, 0, math.inf, math.inf, residual_counts(np.empty(0)))
    return Iterate(
        slowness, slowness, np.zeros((slowness.ndim, *slowness.shape)), np.zeros_like(slowness), best
    )


def trace_rays(problem: Problem, settings: Settings, slowness: Floats, emitters: Ints) -> Rows:
    """Rows of some emitters through an image; any split of the emitters gives the same.

    In an image without contrast, as the water that the first iteration begins with, rays are straight.
    """
    rays: RayKind = settings.rays if slowness.min() < slowness.max() else "straight"
    return linearise(
        problem,
        ray_slowness(problem, settings, slowness),
        emitters,
        rays=rays,
        eikonal=settings.ray_eikonal,
        front=front_smoothing(problem, settings),
    )


def step(
    problem: Problem, settings: Settings, state: Iterate, parts: Sequence[Rows], slice_index: int = 0
) -> Iterate:
    """The next image from the rows of all emitters, in their order; at the end, the best of those measured.

    Of two with about the same misfit the last one is returned, which fulfils the penalty better.

    There is one image less than ``settings.iterations``, because the last iteration only measures the misfit;
    a single iteration makes one image without measuring it.

    The strength of the total variation follows the misfit: strong while rays are still wrong, so that their
    errors do not become structure, and in the end as weak as the data are exact.
    """
    residual = np.concatenate([part.residual for part in parts])
    rms = math.sqrt(float((residual**2).mean()))
    number = len(state.history) + 1
    record = Iteration(slice_index, number, rms, len(problem.active_emitters), given=False)
    history = (*state.history, record)
    best, limit = state.best, huber.limit(residual, settings.numerics.huber_scale)
    against = huber.loss(residual, best.limit)
    here = Measured(state.slowness, number, limit, huber.loss(residual, limit), residual_counts(residual))
    if against < best.loss:
        best = here
    worse = against > state.best.loss
    grown = worse and state.halvings < MOST_HALVINGS
    # Not even a fraction of the step makes it better.
    lost = worse and not grown
    idle = state.idle + (not grown) if against > LEAST_GAIN * state.best.loss else 0
    stuck = lost or idle == PATIENCE
    # The last pass only measures what the one before gave.
    last = number == settings.iterations
    if number > 1 and (stuck or last or settings.numerics.explained(rms)):
        best = here if against < state.best.loss / LEAST_GAIN else best
        history = tuple(replace(sweep, given=sweep.sweep == best.sweep) for sweep in history)
        return replace(state, slowness=best.slowness, best=best, history=history, done=True)
    if grown:
        nearer = 0.5 * (best.slowness + state.slowness)
        return replace(state, slowness=nearer, halvings=state.halvings + 1, history=history)
    lowest, highest = settings.speed_bounds_mps
    coverage = ray_density(problem, parts) * problem.spacing
    # Total variation is scaled by the misfit, s; quadratic penalties are relative to the data.
    unit = huber.clipped_rms(residual, limit) if settings.gauss_newton.penalty == "total-variation" else 1.0
    image, dual = Linearised(
        parts,
        state.slowness * problem.spacing,
        problem.mean_in_region(coverage) / problem.spacing,
        problem.region,
        (problem.spacing / highest, problem.spacing / lowest),
        settings.gauss_newton.penalty_strength * unit,
        settings.gauss_newton.penalty,
        limit,
        state.begun * problem.spacing,
        problem.spacing * settings.gauss_newton.edge_mps / problem.water_speed**2 or math.inf,
        width_in_nodes(problem, settings),
    ).solve(state.dual)
    return replace(
        state,
        slowness=np.where(problem.region, image / problem.spacing, state.slowness),
        dual=dual,
        coverage=coverage,
        best=best,
        halvings=0,
        idle=idle,
        done=settings.iterations == 1,
        history=history,
    )

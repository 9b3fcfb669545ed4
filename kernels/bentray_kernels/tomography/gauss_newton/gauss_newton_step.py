"""Gauss–Newton with bent rays: all emitters at once, then one linear problem with total variation.

Unlike in SART, where each emitter needs the image of the previous one, the emitters of an iteration are
independent: a slice can use as many workers as it has emitters.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Floats, Ints
from ..finite_frequency import width_in_nodes
from ..problem import Problem
from ..result import Iteration, residual_counts
from ..settings import Settings
from . import huber
from .linear_problem import Linearised
from .linearisation import Rows, linearise, ray_density

# A misfit above this part of the previous best is no gain, and ``PATIENCE`` consecutive images without gain
# end the iteration. One does not: the first image of bent rays may have the misfit of straight rays, the next
# one a far lower misfit.
MIN_GAIN = 0.98
PATIENCE = 2

# Most halvings of a step that increases the misfit: the linearisation holds only near the image.
MAX_HALVINGS = 3


@dataclass(frozen=True)
class Measured:
    """An image with its misfit.

    Attributes:
        slowness: of the region's shape, s/m.
        iteration: number of the iteration that evaluated it, from 1; 0 for none.
        limit: Huber limit of its residuals, s.
        loss: of its residuals, s; see ``gauss_newton.huber.loss``.
        residuals: their histogram over ``RESIDUAL_EDGES_S``.
    """

    slowness: Floats
    iteration: int
    limit: float
    loss: float
    residuals: Ints


@dataclass(frozen=True)
class Iterate:
    """State of the iteration; the result of a resumed run has the same bits.

    Attributes:
        slowness: of the region's shape, s/m.
        begun: the initial image.
        dual: (ndim, ...), s, of the last linear problem.
        coverage: as ``slowness``, metres of ray through each node.
        best: the best image so far; each image is compared with it at its Huber limit.
        halvings: of the last step.
        idle: consecutive images without gain.
        done: whether the iteration has ended.
        history: a record per iteration, with the misfit of its initial image.
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
    def iteration(self) -> int:
        """Iterations finished."""
        return len(self.history)

    @property
    def emitter(self) -> int:
        """Emitters done in the current iteration: none, because an iteration is one step."""
        return 0

    @property
    def residuals(self) -> Ints:
        """Histogram of the residuals of the best image; see ``Measured``."""
        return self.best.residuals


def begin(slowness: Floats) -> Iterate:
    """The state that begins with an image, of the region's shape, s/m."""
    best = Measured(slowness, 0, math.inf, math.inf, residual_counts(np.empty(0)))
    return Iterate(
        slowness, slowness, np.zeros((slowness.ndim, *slowness.shape)), np.zeros_like(slowness), best
    )


def trace_rays(problem: Problem, settings: Settings, slowness: Floats, emitters: Ints) -> Rows:
    """Rows by ``linearise``; rays are straight in an image without contrast, such as the initial water."""
    if not slowness.min() < slowness.max():
        settings = replace(settings, rays="straight")
    return linearise(problem, settings, slowness, emitters)


def step(
    problem: Problem, settings: Settings, state: Iterate, blocks: Sequence[Rows], slice_index: int = 0
) -> Iterate:
    """The next image from the rows of all emitters, in their order; at the end, the best image.

    Of images with about the same misfit the last one is returned, which fulfils the penalty better. The last
    iteration only evaluates the misfit, so there is one image less than ``settings.iterations``; a single
    iteration makes one image without evaluating it.

    The strength of the total variation is proportional to the misfit: strong while the rays are inaccurate,
    so that their errors do not become structure, and finally as weak as the data are accurate.
    """
    residual = np.concatenate([block.residual for block in blocks])
    rms = math.sqrt(float((residual**2).mean()))
    number = len(state.history) + 1
    record = Iteration(slice_index, number, rms, len(problem.active_emitters), given=False)
    history = (*state.history, record)
    best, limit = state.best, huber.limit(residual, settings.numerics.huber_scale)
    loss = huber.loss(residual, best.limit)
    current = Measured(state.slowness, number, limit, huber.loss(residual, limit), residual_counts(residual))
    if loss < best.loss:
        best = current
    worse = loss > state.best.loss
    halve = worse and state.halvings < MAX_HALVINGS
    idle = state.idle + (not halve) if loss > MIN_GAIN * state.best.loss else 0
    stuck = (worse and not halve) or idle == PATIENCE
    # The last iteration only evaluates the previous image.
    last = number == settings.iterations
    if number > 1 and (stuck or last or settings.numerics.residual_within_noise(rms)):
        best = current if loss < state.best.loss / MIN_GAIN else best
        history = tuple(replace(record, given=record.sweep == best.iteration) for record in history)
        return replace(state, slowness=best.slowness, best=best, history=history, done=True)
    if halve:
        middle = 0.5 * (best.slowness + state.slowness)
        return replace(state, slowness=middle, halvings=state.halvings + 1, history=history)
    lowest, highest = settings.speed_bounds_mps
    coverage = ray_density(problem, blocks) * problem.spacing
    # Total variation is scaled by the misfit, s; quadratic penalties are relative to the data.
    unit = huber.clipped_rms(residual, limit) if settings.numerics.penalty == "total-variation" else 1.0
    image, dual = Linearised(
        blocks,
        state.slowness * problem.spacing,
        problem.mean_in_region(coverage) / problem.spacing,
        problem.region,
        (problem.spacing / highest, problem.spacing / lowest),
        settings.gauss_newton.penalty_strength * unit,
        settings.numerics.penalty,
        limit,
        state.begun * problem.spacing,
        problem.spacing * settings.numerics.edge_mps / problem.water_speed**2 or math.inf,
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

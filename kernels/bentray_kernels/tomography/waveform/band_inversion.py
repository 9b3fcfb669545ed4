"""Waveform refinement of an image in one band: misfits of single emitters, then one step from all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter

from ...arrays import Floats, Ints
from ...wave.adjoint import misfit_gradient
from ...wave.simulation import simulate
from .lbfgs import append_pair, search_direction
from .waveform_problem import WaveProblem
from .waveform_settings import Steps, WaveSettings

# Illumination below this part of its mean counts as that part.
DARK = 0.1

# A step that makes the misfit grow is shortened so often at most.
MOST_SHORTENINGS = 4

# Held-out emitters may be predicted this much worse than at best before their misfit counts as risen, and it
# must do so in that many images in turn: the cycle-skip guard.
LEEWAY = 1.1
PATIENCE = 2


class Model(NamedTuple):
    """What waves go through, on the grid of the problem.

    Attributes:
        speed: (nx, ny), m/s.
        attenuation: (nx, ny), beyond the water's, Np/m; None: nowhere.
    """

    speed: Floats
    attenuation: Floats | None = None


class EmitterMisfit(NamedTuple):
    """Misfit and gradient of some emitters, summed in their order.

    Attributes:
        misfit: of the emitters that make the image.
        held: of held-out emitters.
        gradient: (nx, ny), by the band's unknown.
        illumination: (nx, ny).
    """

    misfit: float
    held: float
    gradient: Floats
    illumination: Floats


@dataclass(frozen=True)
class Evaluation:
    """Misfits of one image.

    Attributes:
        misfit: a mean over the emitters that make the image.
        held: over held-out emitters; NaN without any.
        accepted: whether the iteration continued from it.
    """

    misfit: float
    held: float
    accepted: bool


@dataclass(frozen=True)
class InversionState:
    """State of the inversion in a band; the result of a resumed run has the same bits.

    Images are of the band's unknown, m/s or Np/m.

    Attributes:
        image: (nx, ny), to be evaluated next; at the end the last that was accepted, or ``best`` where
            skipped and of the attenuation, in which noise and what the speed has wrong show first.
        base: (nx, ny), the last image that was accepted, with its ``gradient`` (nx, ny).
        misfit: of the base; infinite before the first evaluation.
        way: (nx, ny), what was added to the base.
        illumination: (nx, ny), of the first image; it shapes all steps of the band.
        steps, changes: (pairs, nx, ny), of images and gradients.
        best: (nx, ny), the image with the least held-out misfit, ``best_held``.
        risen: images in turn that held-out emitters were predicted worse in.
        shortenings: of the step under way.
        skipped: whether held-out emitters ended it, so that cycles were skipped or noise was fitted.
        done: whether the band has ended.
        history: a record for each image.
    """

    image: Floats
    base: Floats
    gradient: Floats
    misfit: float
    way: Floats
    illumination: Floats
    steps: Floats
    changes: Floats
    best: Floats
    best_held: float
    risen: int = 0
    shortenings: int = 0
    skipped: bool = False
    done: bool = False
    history: tuple[Evaluation, ...] = ()


def begin(image: Floats) -> InversionState:
    """An image to begin with, (nx, ny), on the grid of the problem."""
    nothing, none = np.zeros_like(image), np.zeros((0, *image.shape))
    return InversionState(
        image, image, nothing, float("inf"), nothing, nothing, none, none, image, float("inf")
    )


def emitters(problem: WaveProblem) -> Ints:
    """Emitters to evaluate in each iteration: those that make the image, then those held out."""
    return np.concatenate((problem.used, problem.held))


def evaluate(problem: WaveProblem, settings: WaveSettings, model: Model, some: Ints) -> EmitterMisfit:
    """Misfit of some of ``emitters(problem)``, and its gradient by the band's unknown."""
    judging = set(problem.held.tolist())
    medium, by = problem.medium(*model), problem.band.of
    kind = settings.measure(by)
    misfit, held = 0.0, 0.0
    gradient, illumination = np.zeros_like(model.speed), np.zeros_like(model.speed)
    for emitter in some.tolist():
        valid = problem.valid_receivers(emitter)
        recorded = problem.recorded(emitter, valid)
        window = problem.window(emitter, valid, settings.window_s)
        at, receivers = problem.emitters[emitter], problem.receivers[valid]
        if emitter in judging:
            traces = simulate(medium, at, receivers, problem.wavelet, poll=problem.poll)
            held += kind(traces, recorded, window)[0]
            continue
        compare = partial(kind, recorded=recorded, weight=window)
        found = misfit_gradient(
            medium, at, receivers, problem.wavelet, compare, problem.every, by, problem.poll
        )
        misfit += found.misfit
        gradient += found.gradient
        illumination += found.illumination
    return EmitterMisfit(misfit, held, gradient, illumination)


def step(
    problem: WaveProblem, settings: WaveSettings, state: InversionState, parts: Sequence[EmitterMisfit]
) -> InversionState:
    """The next image from the misfits of all emitters, in their order."""
    misfit = sum(part.misfit for part in parts) / problem.used.size
    held = sum(part.held for part in parts) / problem.held.size if problem.held.size else float("nan")
    gradient = np.where(problem.region, sum(part.gradient for part in parts), 0.0) / problem.used.size
    if not state.history:
        light = sum(part.illumination for part in parts)
        state = replace(state, illumination=np.asarray(light))
    accepted = misfit < state.misfit
    history = (*state.history, Evaluation(misfit, held, accepted))
    state = replace(state, history=history)
    if not accepted:
        return _shortened(problem, settings.steps(problem.band.of), state, misfit)
    steps, changes = state.steps, state.changes
    if len(history) > 1:
        steps, changes = append_pair(
            steps, changes, state.image - state.base, gradient - state.gradient, settings.memory
        )
    risen = state.risen + 1 if held > LEEWAY * state.best_held else 0
    better = not problem.held.size or held < state.best_held
    best, best_held = (state.image, held) if better else (state.best, state.best_held)
    over = sum(record.accepted for record in history) > problem.band.iterations
    skipped = risen >= PATIENCE
    state = replace(
        state,
        base=state.image,
        gradient=gradient,
        misfit=misfit,
        steps=steps,
        changes=changes,
        best=best,
        best_held=best_held,
        risen=risen,
        shortenings=0,
        skipped=skipped,
    )
    if over or skipped or not gradient.any():
        return _ended(problem, state)
    limits = settings.steps(problem.band.of)
    way = _search_direction(problem, limits, state)
    return replace(state, way=way, image=np.clip(state.base + way, *limits.bounds))


def _search_direction(problem: WaveProblem, limits: Steps, state: InversionState) -> Floats:
    """What to add to the base, (nx, ny)."""
    light = state.illumination
    dim = 1.0 / np.sqrt(light + DARK * light[problem.region].mean())
    width = problem.band.smoothing_m / problem.band.spacing_m

    def prior(image: Floats) -> Floats:
        # Symmetric, so that it is a metric: half of the light before the smoothing and half after.
        smooth = gaussian_filter(np.where(problem.region, dim * image, 0.0), width)
        return np.where(problem.region, dim * smooth, 0.0)

    way = -search_direction(state.gradient, state.steps, state.changes, prior)
    size = float(np.sqrt((way[problem.region] ** 2).mean()))
    if not len(state.steps):
        return way * (limits.first / size)
    return way * min(1.0, limits.largest / size)


def _ended(problem: WaveProblem, state: InversionState) -> InversionState:
    judged = state.skipped or problem.band.of == "attenuation"
    return replace(state, image=state.best if judged else state.base, done=True)


def _shortened(problem: WaveProblem, limits: Steps, state: InversionState, misfit: float) -> InversionState:
    """A shorter step along the same way, to the lowest point of the parabola through what is known."""
    if state.shortenings == MOST_SHORTENINGS:
        return _ended(problem, state)
    fall = float((state.gradient * state.way).sum())
    bend = misfit - state.misfit - fall
    factor = min(max(-0.5 * fall / bend, 0.1), 0.5) if bend > 0.0 else 0.5
    way = factor * state.way
    moved = np.clip(state.base + way, *limits.bounds)
    return replace(state, way=way, image=moved, shortenings=state.shortenings + 1)


def given_by(history: Sequence[Evaluation], *, judged: bool) -> int:
    """Number of the image that a finished band returned, from 0.

    Args:
        history: of the band.
        judged: whether it returned the image with the least held-out misfit, and not the last.
    """
    accepted = [k for k, record in enumerate(history) if record.accepted]
    if judged and not math.isnan(history[0].held):
        return min(accepted, key=lambda k: history[k].held)
    return accepted[-1]

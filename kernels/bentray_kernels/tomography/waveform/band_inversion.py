"""Waveform refinement of an image in one band: looks of single emitters, then one step from all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter

from ...arrays import Floats, Ints
from ...wave.adjoint import slope
from ...wave.simulation import simulate
from .lbfgs import direction, remember
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


class Look(NamedTuple):
    """What some emitters say of an image; a sum in their order.

    Attributes:
        misfit: of the emitters that make the image.
        held: of those that judge.
        gradient: (nx, ny), by the band's unknown.
        illumination: (nx, ny).
    """

    misfit: float
    held: float
    gradient: Floats
    illumination: Floats


@dataclass(frozen=True)
class WavePass:
    """One image that was looked at.

    Attributes:
        misfit: a mean over the emitters that make the image.
        held: over those that judge; NaN without any.
        taken: whether the iteration went on from it.
    """

    misfit: float
    held: float
    taken: bool


@dataclass(frozen=True)
class WaveIterate:
    """Where a refinement stands in a band; all that is needed to go on, to the bit.

    Images are of the band's unknown, m/s or Np/m.

    Attributes:
        image: (nx, ny), to be looked at next; at the end the last that was taken, or ``best`` where skipped
            and of the attenuation, in which noise and what the speed has wrong show first.
        base: (nx, ny), the last image that was taken, with its ``gradient`` (nx, ny).
        misfit: of the base; infinite before the first look.
        way: (nx, ny), what was added to the base.
        illumination: (nx, ny), of the first image; it shapes all steps of the band.
        steps, changes: (pairs, nx, ny), of images and gradients.
        best: (nx, ny), the image that held-out emitters like best; ``best_held`` their misfit.
        risen: images in turn that held-out emitters were predicted worse in.
        shortenings: of the step under way.
        skipped: whether held-out emitters ended it, so that cycles were skipped or noise was fitted.
        done: whether nothing is left to do.
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
    history: tuple[WavePass, ...] = ()


def begin(image: Floats) -> WaveIterate:
    """An image to begin with, (nx, ny), on the grid of the problem."""
    nothing, none = np.zeros_like(image), np.zeros((0, *image.shape))
    return WaveIterate(image, image, nothing, float("inf"), nothing, nothing, none, none, image, float("inf"))


def emitters(problem: WaveProblem) -> Ints:
    """Emitters to look at in each iteration: those that make the image, then those that judge."""
    return np.concatenate((problem.used, problem.held))


def look(problem: WaveProblem, settings: WaveSettings, model: Model, some: Ints) -> Look:
    """Misfit of some of ``emitters(problem)``, and its gradient by the band's unknown."""
    judging = set(problem.held.tolist())
    medium, by = problem.medium(*model), problem.band.of
    kind = settings.measure(by)
    misfit, held = 0.0, 0.0
    gradient, illumination = np.zeros_like(model.speed), np.zeros_like(model.speed)
    for emitter in some.tolist():
        heard = problem.heard(emitter)
        recorded = problem.recorded(emitter, heard)
        window = problem.window(emitter, heard, settings.window_s)
        at, receivers = problem.emitters[emitter], problem.receivers[heard]
        if emitter in judging:
            traces = simulate(medium, at, receivers, problem.wavelet, poll=problem.poll)
            held += kind(traces, recorded, window)[0]
            continue
        compare = partial(kind, recorded=recorded, weight=window)
        found = slope(medium, at, receivers, problem.wavelet, compare, problem.every, by, problem.poll)
        misfit += found.misfit
        gradient += found.gradient
        illumination += found.illumination
    return Look(misfit, held, gradient, illumination)


def step(
    problem: WaveProblem, settings: WaveSettings, state: WaveIterate, looks: Sequence[Look]
) -> WaveIterate:
    """The next image from the looks of all emitters, in their order."""
    misfit = sum(part.misfit for part in looks) / problem.used.size
    held = sum(part.held for part in looks) / problem.held.size if problem.held.size else float("nan")
    gradient = np.where(problem.region, sum(part.gradient for part in looks), 0.0) / problem.used.size
    if not state.history:
        light = sum(part.illumination for part in looks)
        state = replace(state, illumination=np.asarray(light))
    taken = misfit < state.misfit
    history = (*state.history, WavePass(misfit, held, taken))
    state = replace(state, history=history)
    if not taken:
        return _shortened(problem, settings.steps(problem.band.of), state, misfit)
    steps, changes = state.steps, state.changes
    if len(history) > 1:
        steps, changes = remember(
            steps, changes, state.image - state.base, gradient - state.gradient, settings.memory
        )
    risen = state.risen + 1 if held > LEEWAY * state.best_held else 0
    better = not problem.held.size or held < state.best_held
    best, best_held = (state.image, held) if better else (state.best, state.best_held)
    over = sum(record.taken for record in history) > problem.band.iterations
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
    way = _way(problem, limits, state)
    return replace(state, way=way, image=np.clip(state.base + way, *limits.bounds))


def _way(problem: WaveProblem, limits: Steps, state: WaveIterate) -> Floats:
    """What to add to the base, (nx, ny)."""
    light = state.illumination
    dim = 1.0 / np.sqrt(light + DARK * light[problem.region].mean())
    width = problem.band.smoothing_m / problem.band.spacing_m

    def prior(image: Floats) -> Floats:
        # Symmetric, so that it is a metric: half of the light before the smoothing and half after.
        smooth = gaussian_filter(np.where(problem.region, dim * image, 0.0), width)
        return np.where(problem.region, dim * smooth, 0.0)

    way = -direction(state.gradient, state.steps, state.changes, prior)
    size = float(np.sqrt((way[problem.region] ** 2).mean()))
    if not len(state.steps):
        return way * (limits.first / size)
    return way * min(1.0, limits.largest / size)


def _ended(problem: WaveProblem, state: WaveIterate) -> WaveIterate:
    judged = state.skipped or problem.band.of == "attenuation"
    return replace(state, image=state.best if judged else state.base, done=True)


def _shortened(problem: WaveProblem, limits: Steps, state: WaveIterate, misfit: float) -> WaveIterate:
    """A shorter step along the same way, to the lowest point of the parabola through what is known."""
    if state.shortenings == MOST_SHORTENINGS:
        return _ended(problem, state)
    fall = float((state.gradient * state.way).sum())
    bend = misfit - state.misfit - fall
    factor = min(max(-0.5 * fall / bend, 0.1), 0.5) if bend > 0.0 else 0.5
    way = factor * state.way
    moved = np.clip(state.base + way, *limits.bounds)
    return replace(state, way=way, image=moved, shortenings=state.shortenings + 1)


def given_by(history: Sequence[WavePass], *, judged: bool) -> int:
    """Which of the images that were looked at a finished band gave, from 0.

    Args:
        history: of the band.
        judged: whether it gave the image that held-out emitters like best, and not the last.
    """
    taken = [k for k, record in enumerate(history) if record.taken]
    if judged and not math.isnan(history[0].held):
        return min(taken, key=lambda k: history[k].held)
    return taken[-1]

"""Waveform refinement of an image in one band: misfits of single emitters, then one step from all of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter

from ...arrays import Floats, Ints
from ...wave.emissions import EmissionMisfit, Emissions, Observed, emission_misfits, misfit_gradients
from .lbfgs import append_pair, search_direction
from .waveform_problem import WaveProblem
from .waveform_settings import Steps, WaveSettings

# Illumination below this part of its mean counts as that part.
DARK = 0.1

# Most times that a step which increases the misfit is shortened.
MAX_BACKTRACKS = 4

# Cycle-skip guard: the band ends once the held-out misfit exceeds ``LEEWAY`` times its minimum in
# ``PATIENCE`` consecutive images.
LEEWAY = 1.1
PATIENCE = 2


class Model(NamedTuple):
    """Speed and attenuation on the grid of the problem.

    Attributes:
        speed: (nx, ny), m/s.
        attenuation: (nx, ny), beyond the water's, Np/m; None: zero.
        wavelet: (steps,), the source, estimated anew for the band; None: that of the problem.
    """

    speed: Floats
    attenuation: Floats | None = None
    wavelet: Floats | None = None


class EmitterMisfit(NamedTuple):
    """Misfit and gradient of some emitters, summed in their order.

    Attributes:
        misfit: of the emitters used.
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
        misfit: mean over the emitters used.
        held: mean over held-out emitters; NaN without any.
        accepted: whether the iteration continued from this image.
    """

    misfit: float
    held: float
    accepted: bool


@dataclass(frozen=True)
class InversionState:
    """State of the inversion in a band; the result of a resumed run has the same bits.

    Images are of the band's unknown, m/s or Np/m.

    Attributes:
        image: (nx, ny), to be evaluated next. At the end the last accepted image; ``best`` if the band was
            skipped, and for the attenuation, which noise and errors of the speed affect first.
        accepted_image: (nx, ny), the last one, with its ``gradient`` (nx, ny).
        misfit: of the accepted image; infinite before the first evaluation.
        step: (nx, ny), from the accepted image to the image.
        illumination: (nx, ny), of the first image; used in all steps of the band.
        steps, changes: (pairs, nx, ny), differences of images and of gradients.
        best: (nx, ny), the image with the lowest held-out misfit, ``best_held``.
        consecutive_increases: consecutive images with a higher held-out misfit.
        backtracks: of the current step.
        skipped: whether the held-out misfit ended the band: cycles were skipped or noise was fitted.
        done: whether the band has ended.
        history: a record for each image.
    """

    image: Floats
    accepted_image: Floats
    gradient: Floats
    misfit: float
    step: Floats
    illumination: Floats
    steps: Floats
    changes: Floats
    best: Floats
    best_held: float
    consecutive_increases: int = 0
    backtracks: int = 0
    skipped: bool = False
    done: bool = False
    history: tuple[Evaluation, ...] = ()


def begin(image: Floats) -> InversionState:
    """The state that begins with an image, (nx, ny), on the grid of the problem."""
    zero, none = np.zeros_like(image), np.zeros((0, *image.shape))
    return InversionState(image, image, zero, math.inf, zero, zero, none, none, image, math.inf)


def emitters(problem: WaveProblem) -> Ints:
    """Emitters to evaluate in each iteration: those used, then those held out."""
    return np.concatenate((problem.used, problem.held))


def evaluate(problem: WaveProblem, settings: WaveSettings, model: Model, emitters: Ints) -> EmitterMisfit:
    """Misfit of some of ``emitters(problem)``, and its gradient by the band's unknown."""
    medium, by = problem.medium(model.speed, model.attenuation), problem.band.of
    measure = settings.measure(by)
    held_out = np.isin(emitters, problem.held)

    def emissions(emitters: Ints) -> Emissions:
        valid = [problem.valid_receivers(emitter) for emitter in emitters.tolist()]
        wavelet = problem.wavelet if model.wavelet is None else model.wavelet
        until = [
            problem.until(emitter, samples, settings.window_s)
            for emitter, samples in zip(emitters.tolist(), valid, strict=True)
        ]
        return Emissions(problem.emitters[emitters], problem.receivers, valid, wavelet, until)

    def compare(emitter: int, traces: Floats) -> tuple[float, Floats]:
        valid = problem.valid_receivers(emitter)
        window = problem.window(emitter, valid, settings.window_s)
        return measure(traces, problem.recorded(emitter, valid), window)

    def misfit_and_data(emitters: Ints) -> tuple[EmissionMisfit, Observed]:
        numbers = emitters.tolist()
        return (
            lambda k, traces: compare(numbers[k], traces),
            Observed(settings.program(by), lambda k: problem.observed(numbers[k], settings.window_s)),
        )

    validated, used = emitters[held_out], emitters[~held_out]
    misfit_of, observed = misfit_and_data(validated)
    engine, poll = settings.engine, problem.poll
    held = sum(emission_misfits(medium, emissions(validated), misfit_of, poll, engine, observed), 0.0)
    misfit_of, observed = misfit_and_data(used)
    misfit = 0.0
    gradient, illumination = np.zeros_like(model.speed), np.zeros_like(model.speed)
    shots, every = emissions(used), problem.every
    for shot in misfit_gradients(medium, shots, misfit_of, every, by, poll, engine, observed):
        misfit += shot.misfit
        gradient += shot.gradient
        illumination += shot.illumination
    return EmitterMisfit(misfit, held, gradient, illumination)


def step(
    problem: WaveProblem, settings: WaveSettings, state: InversionState, misfits: Sequence[EmitterMisfit]
) -> InversionState:
    """The next image from the misfits of all emitters, in their order."""
    misfit = sum(term.misfit for term in misfits) / problem.used.size
    held = sum(term.held for term in misfits) / problem.held.size if problem.held.size else math.nan
    gradient = np.where(problem.region, sum(term.gradient for term in misfits), 0.0) / problem.used.size
    if not state.history:
        illumination = sum(term.illumination for term in misfits)
        state = replace(state, illumination=np.asarray(illumination))
    accepted = misfit < state.misfit
    history = (*state.history, Evaluation(misfit, held, accepted))
    state = replace(state, history=history)
    if not accepted:
        return _backtracked(problem, settings.steps(problem.band.of), state, misfit)
    steps, changes = state.steps, state.changes
    if len(history) > 1:
        steps, changes = append_pair(
            steps, changes, state.image - state.accepted_image, gradient - state.gradient
        )
    consecutive_increases = state.consecutive_increases + 1 if held > LEEWAY * state.best_held else 0
    better = not problem.held.size or held < state.best_held
    best, best_held = (state.image, held) if better else (state.best, state.best_held)
    over = sum(record.accepted for record in history) > problem.band.iterations
    skipped = consecutive_increases >= PATIENCE
    state = replace(
        state,
        accepted_image=state.image,
        gradient=gradient,
        misfit=misfit,
        steps=steps,
        changes=changes,
        best=best,
        best_held=best_held,
        consecutive_increases=consecutive_increases,
        backtracks=0,
        skipped=skipped,
    )
    if over or skipped or not gradient.any():
        return _ended(problem, state)
    limits = settings.steps(problem.band.of)
    direction = _search_direction(problem, limits, state)
    return replace(state, step=direction, image=np.clip(state.accepted_image + direction, *limits.bounds))


def _search_direction(problem: WaveProblem, limits: Steps, state: InversionState) -> Floats:
    """The step from the accepted image, (nx, ny): L-BFGS with the illumination as preconditioner."""
    illumination = state.illumination
    preconditioner = 1.0 / np.sqrt(illumination + DARK * illumination[problem.region].mean())
    width = problem.band.smoothing_m / problem.band.spacing_m

    def prior(image: Floats) -> Floats:
        # Symmetric, as a metric must be: the root of the illumination before the smoothing and after it.
        smooth = gaussian_filter(np.where(problem.region, preconditioner * image, 0.0), width)
        return np.where(problem.region, preconditioner * smooth, 0.0)

    direction = -search_direction(state.gradient, state.steps, state.changes, prior)
    size = float(np.sqrt((direction[problem.region] ** 2).mean()))
    if not len(state.steps):
        return direction * (limits.first / size)
    return direction * min(1.0, limits.largest / size)


def _ended(problem: WaveProblem, state: InversionState) -> InversionState:
    by_held_out = state.skipped or problem.band.of == "attenuation"
    return replace(state, image=state.best if by_held_out else state.accepted_image, done=True)


def _backtracked(problem: WaveProblem, limits: Steps, state: InversionState, misfit: float) -> InversionState:
    """A shorter step in the same direction, to the minimum of the parabola through both misfits."""
    if state.backtracks == MAX_BACKTRACKS:
        return _ended(problem, state)
    fall = float((state.gradient * state.step).sum())
    bend = misfit - state.misfit - fall
    factor = min(max(-0.5 * fall / bend, 0.1), 0.5) if bend > 0.0 else 0.5
    direction = factor * state.step
    moved = np.clip(state.accepted_image + direction, *limits.bounds)
    return replace(state, step=direction, image=moved, backtracks=state.backtracks + 1)


def given_by(history: Sequence[Evaluation], *, by_held_out: bool) -> int:
    """Index of the image that a finished band returned.

    Args:
        history: of the band.
        by_held_out: whether it returned the image with the lowest held-out misfit instead of the last.
    """
    accepted = [k for k, record in enumerate(history) if record.accepted]
    if by_held_out and not math.isnan(history[0].held):
        return min(accepted, key=lambda k: history[k].held)
    return accepted[-1]

"""Whole reconstructions in this process, and the assembly that every runner shares."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from ..acquisition import Dataset
from ..arrays import Ints
from . import attenuation, gauss_newton, sart
from .problem import SliceProblem
from .result import Progress, Reconstruction
from .settings import Settings

# Emitters between two reports of progress.
BATCH = 16

State = sart.State | gauss_newton.Iterate


def reconstruct(
    dataset: Dataset, settings: Settings, progress: Callable[[Progress], None] | None = None
) -> Reconstruction:
    """Reconstruct every slice of a dataset, one after the other.

    Args:
        dataset: with travel times; traces must have been picked.
        settings: see ``Settings``.
        progress: called after each batch of emitters.

    Returns:
        The images and how they came about. The same dataset and settings give the same bits.

    Raises:
        InvalidInput: from the dataset or a setting that does not fit it.
    """
    problems = [problem_of(dataset, settings, k) for k in range(dataset.slices)]
    states = [begin(settings, problem) for problem in problems]
    report = progress or (lambda _: None)
    while not all(state.done for state in states):
        for k, problem in enumerate(problems):
            state = states[k]
            if isinstance(state, sart.State):
                states[k] = sart.advance(problem, settings, state, BATCH, k)
            elif not state.done:
                rows = []
                for emitters in batches(problem):
                    rows.append(gauss_newton.look(problem, settings, state.slowness, state.sweep, emitters))
                    looked = sum(part.emitters for part in rows)
                    report(measure(problems, settings, states, looked))
                states[k] = gauss_newton.step(problem, settings, state, rows, k)
            report(measure(problems, settings, states))
    for k, problem in enumerate(problems):
        losses = []
        for emitters in batches_of_losses(problem, settings):
            losses.append(attenuation.look(problem, settings, states[k].slowness, emitters))
            report(measure(problems, settings, states, sum(part.emitters for part in losses)))
        if losses:
            found = attenuation.attenuation(problem, settings, losses)
            states[k] = replace(states[k], attenuation=found)
    return assemble(dataset, settings, problems, states)


def problem_of(dataset: Dataset, settings: Settings, index: int) -> SliceProblem:
    """One slice's problem as the settings' method wants it.

    Raises:
        InvalidInput: as ``SliceProblem.of``.
    """
    problem = SliceProblem.of(dataset, settings, index)
    if settings.method == "gauss-newton" and settings.reciprocity:
        return gauss_newton.each_pair_once(problem)
    return problem


def begin(settings: Settings, problem: SliceProblem) -> State:
    """Where the settings' method begins."""
    return gauss_newton.begin(problem) if settings.method == "gauss-newton" else sart.begin(problem)


def batches(problem: SliceProblem) -> list[Ints]:
    """The emitters with travel times, ``BATCH`` at a time."""
    return _cut(np.flatnonzero(np.isfinite(problem.delta_tof).any(axis=1)))


def batches_of_losses(problem: SliceProblem, settings: Settings) -> list[Ints]:
    """The emitters with amplitudes, ``BATCH`` at a time; none where nobody wants the attenuation."""
    return _cut(attenuation.heard(problem)) if settings.attenuation else []


def _cut(emitters: Ints) -> list[Ints]:
    return [emitters[k : k + BATCH] for k in range(0, len(emitters), BATCH)]


def measure(
    problems: Sequence[SliceProblem], settings: Settings, states: Sequence[State], looked: int = 0
) -> Progress:
    """Progress over all slices; a slice that stopped early counts as whole.

    Args:
        problems, states: one a slice.
        settings: of the reconstruction.
        looked: emitters whose rows are there, of iterations that have not made their step.
    """
    done, total = looked, 0
    for problem, state in zip(problems, states, strict=True):
        emitters = int(np.isfinite(problem.delta_tof).any(axis=1).sum())
        losses = sum(len(part) for part in batches_of_losses(problem, settings))
        total += emitters * settings.sweeps + losses
        done += losses if state.attenuation is not None else 0
        done += emitters * settings.sweeps if state.done else emitters * state.sweep + state.emitter
    history = sorted((s for state in states for s in state.history), key=lambda s: (s.sweep, s.slice))
    return Progress(done, total, tuple(history))


def assemble(
    dataset: Dataset, settings: Settings, problems: Sequence[SliceProblem], states: Sequence[State]
) -> Reconstruction:
    """The result of finished slices, (nx, ny) for one and (nx, ny, nz) for several."""
    speed = np.stack([1.0 / state.slowness for state in states], axis=-1)
    coverage = np.stack([state.coverage for state in states], axis=-1)
    losses = [state.attenuation for state in states]
    attenuations = None
    if all(image is not None for image in losses):
        attenuations = np.stack([image for image in losses if image is not None], axis=-1)
    first = problems[0]
    spacing: tuple[float, ...] = (first.spacing, first.spacing)
    origin: tuple[float, ...] = first.origin
    if dataset.slice_z_m is None:
        speed, coverage = speed[..., 0], coverage[..., 0]
        attenuations = None if attenuations is None else attenuations[..., 0]
    else:
        steps = np.diff(dataset.slice_z_m)
        even = steps.size > 0 and np.allclose(steps, steps[0])
        spacing = (*spacing, float(steps[0]) if even else float("nan"))
        origin = (*origin, float(dataset.slice_z_m[0]))
    return Reconstruction(
        speed=np.ascontiguousarray(speed),
        coverage=np.ascontiguousarray(coverage),
        spacing_m=spacing,
        origin_m=origin,
        water_speed_mps=dataset.water_speed_mps,
        settings=settings,
        history=measure(problems, settings, states).history,
        attenuation=None if attenuations is None else np.ascontiguousarray(attenuations),
        provenance=provenance(),
    )


def provenance() -> dict[str, str]:
    """Versions of what computes here, for exact repetition."""
    found = {"python": platform.python_version()}
    for package in ("bentray", "numpy", "numba", "scipy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found

"""Whole reconstructions in this process, and the assembly that every runner shares."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from ..acquisition import Dataset
from .problem import SliceProblem
from .result import Progress, Reconstruction
from .sart import State, advance, begin, emitter_order
from .settings import Settings

# Emitters between two reports of progress.
BATCH = 16


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
    problems = [SliceProblem.of(dataset, settings, k) for k in range(dataset.slices)]
    states = [begin(problem) for problem in problems]
    while not all(state.done for state in states):
        for k, problem in enumerate(problems):
            states[k] = advance(problem, settings, states[k], BATCH, k)
            if progress is not None:
                progress(measure(problems, settings, states))
    return assemble(dataset, settings, problems, states)


def measure(problems: Sequence[SliceProblem], settings: Settings, states: Sequence[State]) -> Progress:
    """Progress over all slices; a slice that stopped early counts as whole."""
    done = total = 0
    for k, (problem, state) in enumerate(zip(problems, states, strict=True)):
        emitters = len(emitter_order(problem, settings.seed, k, 0))
        total += emitters * settings.sweeps
        done += emitters * settings.sweeps if state.done else emitters * state.sweep + state.emitter
    history = sorted((s for state in states for s in state.history), key=lambda s: (s.sweep, s.slice))
    return Progress(done, total, tuple(history))


def assemble(
    dataset: Dataset, settings: Settings, problems: Sequence[SliceProblem], states: Sequence[State]
) -> Reconstruction:
    """The result of finished slices, (nx, ny) for one and (nx, ny, nz) for several."""
    speed = np.stack([1.0 / state.slowness for state in states], axis=-1)
    coverage = np.stack([state.coverage for state in states], axis=-1)
    first = problems[0]
    spacing: tuple[float, ...] = (first.spacing, first.spacing)
    origin: tuple[float, ...] = first.origin
    if dataset.slice_z_m is None:
        speed, coverage = speed[..., 0], coverage[..., 0]
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

"""Whole reconstructions: in this process, or by whatever drives the chains; and their assembly."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from ..acquisition import Dataset
from ..acquisition.picking.amplitudes import with_log_ratios
from ..arrays import Floats
from ..errors import InvalidInput
from . import pairs
from .grid_schedule import stages
from .model_selection.held_out import Part, part_of
from .model_selection.selection import advise
from .problem import Problem
from .result import Progress, Reconstruction, Trial
from .settings import Settings
from .stopping import noise_of
from .task_chains import Calls, Chain, Drive, Scan, attenuate, measured, recover
from .waveform.frequency_continuation import Here as WavesHere
from .waveform.refinement import Following, WaveScanOf
from .waveform.waveform_chain import WaveScan
from .waveform.waveform_settings import WaveSettings


def reconstruct(
    dataset: Dataset, settings: Settings, progress: Callable[[Progress], None] | None = None
) -> Reconstruction:
    """Reconstruct every slice of a dataset one after the other, or its volume.

    Args:
        dataset: with travel times, for ``method`` waveform beside the traces that they were picked from. From
            traces come amplitudes too where the settings want that; without traces they have been read.
        settings: see ``Settings``.
        progress: called after each batch of emitters.

    Returns:
        The images and how they came about. The same dataset and settings give the same bits.

    Raises:
        InvalidInput: from the dataset or a setting that does not fit it.
    """

    def drive(chains: Sequence[Calls], before: int, after: int) -> None:
        for chain in chains:
            waiting = chain.first()
            while waiting:
                call = waiting.pop(0)
                waiting = chain.after(call, call.function(*call.arguments)) + waiting
                if progress is not None:
                    progress(measured(chains, before, after))

    if settings.listens and dataset.waveform is not None:
        dataset = with_log_ratios(dataset, settings.amplitudes)

    def waves_of(plan: WaveSettings, index: int) -> WaveScan:
        return WavesHere(dataset, plan, index=index)

    samples = 0
    if dataset.waveform is not None and dataset.waveform.water is not None:
        samples = dataset.waveform.object.shape[-1]
    return carried_out(
        dataset, settings, lambda plan, part: Here(dataset, plan, part), drive, waves_of, samples
    )


def carried_out(
    dataset: Dataset,
    settings: Settings,
    scan_of: Callable[[Settings, Part], Scan],
    drive: Drive,
    waves_of: WaveScanOf,
    samples: int = 0,
) -> Reconstruction:
    """A reconstruction whose calls are run by ``drive``.

    Args:
        dataset: with travel times.
        settings: see ``Settings``.
        scan_of: makes what tells calls their data.
        drive: runs chains to their end.
        waves_of: makes what tells the calls of a slice's refinement their data.
        samples: of each trace of object and water; 0: none.

    Raises:
        InvalidInput: from the dataset or a setting that does not fit it, and what ``drive`` raises.
    """
    count = pairs.count(dataset, settings)
    trials: tuple[Trial, ...] = ()
    before = 0
    waves = _waves(dataset, settings, samples, waves_of)
    allowed = waves is not None and (settings.method == "waveform" or waves.minutes <= settings.wave_minutes)
    following = waves if allowed else None
    after = following.total if following is not None else waves.passes if waves is not None else 0
    if settings.tries:
        settings, trials, before = advise(dataset, settings, count // 2, scan_of, drive, after)
    scan = scan_of(settings, "all")
    chains = [Chain(scan, index) for index in range(count)]
    drive(chains, before, after)
    rays = _assembled(dataset, settings, scan.problem(0), chains, trials)
    if waves is None:
        return rays
    made = before + sum(chain.total for chain in chains)
    if following is None:
        return waves.advised(rays, noise_of(dataset), drive, made)
    return following.refined(rays, drive, made)


def _waves(dataset: Dataset, settings: Settings, samples: int, waves_of: WaveScanOf) -> Following | None:
    """What may come after the rays; None where only they are asked for, or ``auto`` could not go on."""
    if settings.method not in ("waveform", "auto") or (settings.method == "auto" and not samples):
        return None
    try:
        return Following(dataset, settings, samples, waves_of)
    except InvalidInput:
        if settings.method == "waveform":
            raise
        return None


class Here:
    """A scan in this process; see ``tomography.task_chains.Scan``."""

    def __init__(self, dataset: Dataset, settings: Settings, part: Part) -> None:
        plans = stages(dataset, settings)
        shown = part_of(dataset, part)
        self._plans = plans
        self._made = cache(lambda index, stage: problem_of(shown, plans[stage], index))

    def stages(self) -> tuple[Settings, ...]:
        return self._plans

    def problem(self, index: int, stage: int = -1) -> Problem:
        found: Problem = self._made(index, stage % len(self._plans))
        return found


def problem_of(dataset: Dataset, settings: Settings, index: int) -> Problem:
    """One slice's problem as the settings' method wants it.

    Raises:
        InvalidInput: as ``Problem.of``.
    """
    problem = Problem.of(dataset, settings, index)
    once = settings.method == "gauss-newton" and settings.reciprocity
    return problem.each_pair_once() if once else problem


def _assembled(
    dataset: Dataset,
    settings: Settings,
    first: Problem,
    chains: Sequence[Chain],
    trials: tuple[Trial, ...],
) -> Reconstruction:
    """The result of finished chains: (nx, ny) for one slice, (nx, ny, nz) for several and for a volume."""
    spacing: tuple[float, ...] = (first.spacing,) * first.region.ndim
    origin = first.origin
    z = pairs.heights(dataset)
    stacked = first.region.ndim == 2 and z is not None
    if stacked and z is not None:
        steps = np.diff(z)
        even = steps.size > 0 and np.allclose(steps, steps[0])
        spacing = (*spacing, float(steps[0]) if even else float("nan"))
        origin = (*origin, float(z[0]))

    def image(parts: Sequence[Floats]) -> Floats:
        return np.ascontiguousarray(np.stack(parts, axis=-1)) if stacked else parts[0]

    def wanted(then: Callable[..., Floats]) -> Floats | None:
        parts = [chain.found(then) for chain in chains]
        return None if any(part is None for part in parts) else image(parts)

    return Reconstruction(
        speed=image([1.0 / chain.state.slowness for chain in chains]),
        coverage=image([chain.state.coverage for chain in chains]),
        spacing_m=spacing,
        origin_m=origin,
        water_speed_mps=dataset.water_speed_mps,
        settings=settings,
        history=measured(chains).history,
        attenuation=wanted(attenuate),
        recovery=wanted(recover),
        residuals=np.sum([chain.state.residuals for chain in chains], axis=0),
        trials=trials,
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

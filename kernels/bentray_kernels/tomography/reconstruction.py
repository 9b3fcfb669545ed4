"""Reconstruction of a dataset: model selection, task graphs, optional refinement, assembled result."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Protocol

import numpy as np

from ..acquisition import Dataset
from ..acquisition.element_pitch import element_pitch
from ..acquisition.picking.amplitudes import with_log_ratios
from ..acquisition.plausibility import check_plausible
from ..acquisition.quality.finding import words
from ..acquisition.quality.left_out import find_impossible
from ..arrays import Floats
from ..errors import InvalidInput
from ..task_graph import ThreadPool, run
from . import pairs
from .attenuation import EXPERIMENTAL
from .cautions import bound_cautions, fit_cautions, with_settings_caution
from .decomposition import with_decomposition
from .device_choice import ScanSize, needs_decision, with_device
from .gauss_newton.gauss_newton_step import Iterate
from .geometry_summary import geometry_summary
from .grid_schedule import stages
from .image_grid import automatic_nodes
from .model_selection.held_out import Part, part_of
from .model_selection.selection import select_model
from .numerics import recorded
from .problem import Problem
from .reconstruction_graph import (
    ReconstructionGraph,
    Run,
    TomographyGraph,
    check_resolution,
    estimate_uncertainty,
    progress_of,
    solve_attenuation,
)
from .reflection.memory_echoes import MemoryEchoScan
from .reflection.reflection_plan import Echoes, check_reflection
from .reflection.with_reflection import with_reflection
from .result import Candidate, Caution, Progress, Reconstruction
from .sart.sart_step import State
from .settings import Settings
from .stage_graphs import Scan
from .stopping import travel_time_noise
from .waveform.memory_scan import MemoryWaveScan
from .waveform.refinement import Refinement, WaveScanOf
from .waveform.refinement_graph import WaveScan
from .waveform.waveform_settings import WaveSettings


class FinishedGraph(TomographyGraph, Protocol):
    """A graph that ends with an image."""

    @property
    def state(self) -> State | Iterate: ...

    def value_of(self, evaluate: Callable[..., Any], /) -> Any:
        """See ``ReconstructionGraph``."""


# Makes the graph of a slice or volume, by its index.
GraphOf = Callable[[Scan, int], FinishedGraph]


def reconstruct(
    dataset: Dataset, settings: Settings, progress: Callable[[Progress], None] | None = None
) -> Reconstruction:
    """Reconstruct a dataset in this process, on all its cores.

    Args:
        dataset: with travel times, for ``method`` waveform also the traces that they were picked from.
            Amplitudes are read from traces where the settings say so.
        settings: see ``Settings``.
        progress: called after each batch of emitters.

    Returns:
        The images and how they were computed. The same dataset and settings give the same bits.

    Raises:
        InvalidInput: from the dataset, unless ``examine`` is false as ``check_plausible``, or a setting that
            does not fit it.
    """
    if settings.picking.examine:
        check_plausible(dataset)
    dataset = dataset.in_water_of(settings.water_temperature_c)
    if settings.reads_amplitudes and dataset.waveform is not None:
        dataset = with_log_ratios(dataset, settings.attenuation.amplitudes)

    def run_graphs(graphs: Sequence[TomographyGraph], before: int, after: int) -> None:
        def report(_name: str) -> None:
            if progress is not None:
                progress(progress_of(graphs, before, after))

        run({str(k): graph for k, graph in enumerate(graphs)}, ThreadPool(None), report)

    def wave_scan(plan: WaveSettings, index: int) -> WaveScan:
        return MemoryWaveScan(dataset, plan, index=index)

    recorded, requested = dataset.waveform, settings
    settings = on_this_machine(dataset, settings, 0 if recorded is None else recorded.object.shape[-1])
    echoes = None
    if recorded is not None:
        echoes = Echoes(recorded.object.shape[-1], lambda index: MemoryEchoScan(dataset, index))
    result = run_reconstruction(
        dataset,
        settings,
        lambda plan, part: MemoryScan(dataset, plan, part),
        run_graphs,
        wave_scan,
        0 if recorded is None or recorded.water is None else recorded.object.shape[-1],
        echoes,
    )
    if impossible := find_impossible(dataset.impossible_times):
        result = replace(result, provenance={**result.provenance, "quality": words(impossible)})
    return with_settings_caution(result, requested, picks=False)


def on_this_machine(dataset: Dataset, settings: Settings, samples: int) -> Settings:
    """The settings with the device that this machine computes on, see ``device_choice.with_device``."""
    if not needs_decision(settings):
        return settings
    return settings.changed(device=with_device(*device_request(dataset, settings, samples)).device)


def device_request(dataset: Dataset, settings: Settings, samples: int) -> tuple[ScanSize, Settings]:
    """The arguments of ``device_choice.with_device`` for a dataset with so many samples in a trace."""
    sized = with_nodes(dataset, with_decomposition(dataset.element_position_m, settings))
    return ScanSize(dataset.slices, len(dataset.tx), len(dataset.rx), samples), sized


def run_reconstruction(
    dataset: Dataset,
    settings: Settings,
    scan_of: Callable[[Settings, Part], Scan],
    run_graphs: Run,
    wave_scan_of: WaveScanOf,
    samples: int = 0,
    echoes: Echoes | None = None,
    graph_of: GraphOf = ReconstructionGraph,
) -> Reconstruction:
    """Reconstruct a dataset by task graphs that the caller runs.

    Args:
        dataset: with travel times.
        settings: see ``Settings``.
        scan_of: makes the scan in which tasks find their data.
        run_graphs: runs graphs to their end.
        wave_scan_of: the same as ``scan_of`` for the refinement of a slice.
        samples: of each trace of object and water; 0: none.
        echoes: the traces of the object; None without any.
        graph_of: makes the graph of a slice or volume.

    Raises:
        InvalidInput: from the dataset or a setting that does not fit it, and errors of ``run_graphs``.
    """
    if not settings.reflection.enabled:
        return _speed_of(dataset, settings, scan_of, run_graphs, wave_scan_of, samples, graph_of)
    in_space = dataset.element_position_m.shape[1] == 3
    check_reflection(settings, traces=echoes is not None, in_space=in_space)
    assert echoes is not None
    passes = [0]

    def run_first(graphs: Sequence[TomographyGraph], before: int, after: int) -> None:
        run_graphs(graphs, before, after + dataset.slices * len(dataset.tx))
        passes[0] = before + sum(graph.total for graph in graphs)

    result = _speed_of(dataset, settings, scan_of, run_first, wave_scan_of, samples)
    return with_reflection(result, dataset, settings, echoes, run_graphs, passes[0])


def _speed_of(
    dataset: Dataset,
    settings: Settings,
    scan_of: Callable[[Settings, Part], Scan],
    run_graphs: Run,
    wave_scan_of: WaveScanOf,
    samples: int,
    graph_of: GraphOf = ReconstructionGraph,
) -> Reconstruction:
    """Like ``run_reconstruction``, without the reflection image."""
    requested = settings
    settings = with_nodes(dataset, with_decomposition(dataset.element_position_m, settings))
    count = pairs.count(dataset, settings)
    trials: tuple[Candidate, ...] = ()
    before = 0
    waves = _refinement(dataset, settings, samples, wave_scan_of)
    allowed = waves is not None and (settings.method == "waveform" or waves.within_budget)
    refinement = waves if allowed else None
    after = refinement.total if refinement is not None else waves.passes if waves is not None else 0
    if settings.selects_model:
        settings, trials, before = select_model(dataset, settings, count // 2, scan_of, run_graphs, after)
    scan = scan_of(settings, "all")
    graphs = [graph_of(scan, index) for index in range(count)]
    run_graphs(graphs, before, after)
    rays = _assembled(dataset, settings, scan.problem(0), graphs, trials)
    summary = geometry_summary(dataset, requested, settings, scan.problem(count // 2))
    if summary:
        rays = replace(rays, provenance={**rays.provenance, "geometry": summary})
    if waves is None:
        return rays
    done = before + sum(graph.total for graph in graphs)
    if refinement is None:
        return waves.advised(rays, travel_time_noise(dataset), run_graphs, done)
    return refinement.refined(rays, run_graphs, done)


def _refinement(
    dataset: Dataset, settings: Settings, samples: int, wave_scan_of: WaveScanOf
) -> Refinement | None:
    """The waveform refinement that may follow; None if not requested, or impossible with ``auto``."""
    if settings.method not in ("waveform", "auto") or (settings.method == "auto" and not samples):
        return None
    try:
        return Refinement(dataset, settings, samples, wave_scan_of)
    except InvalidInput:
        if settings.method == "waveform":
            raise
        return None


def with_nodes(dataset: Dataset, settings: Settings) -> Settings:
    """The settings with the number of nodes that is used: the given one, or that of the scan."""
    if settings.nodes is not None:
        return settings
    position, water = dataset.element_position_m, dataset.water_speed_mps
    frequency = dataset.center_frequency_hz
    width = float(np.ptp(position[:, :2], axis=0).max())
    wavelength = None if frequency is None else water / frequency
    noise = travel_time_noise(dataset) if wavelength is None else 0.0
    pitch, elements = element_pitch(position), len(position)
    nodes = automatic_nodes(settings, width, pitch, wavelength, noise, water, elements)
    return settings.changed(nodes=nodes)


class MemoryScan:
    """A scan in the memory of this process; see ``stage_graphs.Scan``."""

    def __init__(self, dataset: Dataset, settings: Settings, part: Part) -> None:
        plans = stages(dataset, settings)
        self._plans = plans
        self._problem = cache(lambda index, stage: problem_of(dataset, plans[stage], index, part))

    def stages(self) -> tuple[Settings, ...]:
        return self._plans

    def problem(self, index: int, stage: int = -1) -> Problem:
        problem: Problem = self._problem(index, stage % len(self._plans))
        return problem

    def problems(self, indices: tuple[int, ...], stage: int = -1) -> tuple[Problem, ...]:
        return tuple(self.problem(index, stage) for index in indices)


def problem_of(dataset: Dataset, settings: Settings, index: int, part: Part = "all") -> Problem:
    """The problem of one slice for the method of the settings, with the pairs of one part.

    Held-out pairs that were measured both ways have their mean, for every method: with half the variance
    of the noise for one method, and all of it for another, misfits could not be compared.

    Raises:
        InvalidInput: as ``Problem.from_dataset``.
    """
    problem = Problem.from_dataset(part_of(dataset, part), settings, index)
    once = settings.method == "gauss-newton" or not (part == "all" or part.startswith("shown"))
    return problem.each_pair_once() if once and settings.numerics.reciprocity else problem


def _assembled(
    dataset: Dataset,
    settings: Settings,
    first: Problem,
    graphs: Sequence[FinishedGraph],
    trials: tuple[Candidate, ...],
) -> Reconstruction:
    """The result of finished graphs: (nx, ny) for one slice, (nx, ny, nz) for several and for a volume."""
    spacing: tuple[float, ...] = (first.spacing,) * first.region.ndim
    origin = first.origin
    z = pairs.heights(dataset)
    stacked = first.region.ndim == 2 and z is not None
    if stacked and z is not None:
        steps = np.diff(z)
        even = steps.size > 0 and np.allclose(steps, steps[0])
        spacing = (*spacing, float(steps[0]) if even else float("nan"))
        origin = (*origin, float(z[0]))

    def image(slices: Sequence[Floats]) -> Floats:
        return np.ascontiguousarray(np.stack(slices, axis=-1)) if stacked else slices[0]

    def evaluated(evaluate: Callable[..., Floats]) -> Floats | None:
        values = [graph.value_of(evaluate) for graph in graphs]
        return None if any(value is None for value in values) else image(values)

    # Read once: images in blocks are in files.
    states = [graph.state for graph in graphs]
    losses = evaluated(solve_attenuation)
    spread = [graph.value_of(estimate_uncertainty) for graph in graphs]
    complete = all(item is not None for item in spread)
    experimental = {} if losses is None else {"attenuation": EXPERIMENTAL}
    speed = image([1.0 / state.slowness for state in states])
    coverage = image([state.coverage for state in states])
    residuals, history = np.sum([state.residuals for state in states], axis=0), progress_of(graphs).history
    bounds, water = settings.speed_bounds_mps, dataset.water_speed_mps
    cautions = [*bound_cautions(speed, coverage, bounds, water)]
    cautions += fit_cautions(dataset, settings, residuals, history)
    if complete and any(item.caution for item in spread):
        cautions.append(Caution("uncertainty", _of_slices([item.caution for item in spread])))
    return Reconstruction(
        speed=speed,
        coverage=coverage,
        spacing_m=spacing,
        origin_m=origin,
        water_speed_mps=water,
        settings=settings,
        history=history,
        attenuation=losses,
        recovery=evaluated(check_resolution),
        uncertainty=image([item.deviation for item in spread]) if complete else None,
        resolution_width_m=tuple(item.width_m for item in spread) if complete else (),
        residuals=residuals,
        trials=trials,
        cautions=tuple(cautions),
        provenance={**provenance(), **recorded(settings.numerics), **experimental},
    )


def _of_slices(slices: Sequence[str]) -> str:
    """The first caution about the uncertainty, and of how many slices there is one."""
    texts = [text for text in slices if text]
    return texts[0] if len(slices) == 1 else f"{texts[0]} (One of {len(texts)} of {len(slices)} slices.)"


def provenance() -> dict[str, str]:
    """Versions of the software, for exact repetition."""
    versions = {"python": platform.python_version()}
    for package in ("bentray", "numpy", "numba", "scipy"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "unknown"
    return versions

"""Reconstruction of a dataset: model selection, task graphs, optional refinement, assembled result."""

import platform
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Protocol

import numpy as np

from ..acquisition import Dataset
from ..acquisition.picking.amplitudes import with_log_ratios
from ..acquisition.plausibility import check_plausible
from ..acquisition.quality.finding import words
from ..acquisition.quality.left_out import find_impossible
from ..arrays import Floats
from ..task_graph import ThreadPool, run
from . import pairs
from .attenuation import EXPERIMENTAL
from .cautions import (
    attenuation_cautions,
    bound_cautions,
    fit_cautions,
    held_out_amplitudes,
    with_settings_caution,
)
from .gauss_newton.gauss_newton_step import Iterate
from .geometry_summary import geometry_summary
from .model_selection.selection import explain_candidates, select_model
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
from .reflection.reflection_plan import check_reflection
from .reflection.with_reflection import with_reflection
from .result import Candidate, Caution, Progress, Reconstruction
from .sart.sart_step import State
from .scan import MemorySource, Scan, Source
from .settings import Settings
from .settled import Settled, in_sentences, reasons_of_model, settled
from .stopping import travel_time_noise
from .waveform.refinement import Refinement


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

    source = MemorySource(dataset)
    result = run_reconstruction(source, settled(source, settings), run_graphs)
    if impossible := find_impossible(dataset.impossible_times):
        result = replace(result, provenance={**result.provenance, "quality": words(impossible)})
    return with_settings_caution(result, settings, picks=False)


def run_reconstruction(
    source: Source, chosen: Settled, run_graphs: Run, graph_of: GraphOf = ReconstructionGraph
) -> Reconstruction:
    """Reconstruct a scan by task graphs that the caller runs.

    Args:
        source: of a scan with travel times.
        chosen: its settings.
        run_graphs: runs graphs to their end.
        graph_of: makes the graph of a slice or volume.

    Raises:
        InvalidInput: from the scan or a setting that does not fit it, and errors of ``run_graphs``.
    """
    if not chosen.settings.reflection.enabled:
        return _speed_of(source, chosen, run_graphs, graph_of)
    dataset = source.dataset()
    in_space = dataset.element_position_m.shape[1] == 3
    check_reflection(chosen.settings, traces=source.samples > 0, in_space=in_space)
    passes = [0]

    def run_first(graphs: Sequence[TomographyGraph], before: int, after: int) -> None:
        run_graphs(graphs, before, after + dataset.slices * len(dataset.tx))
        passes[0] = before + sum(graph.total for graph in graphs)

    result = _speed_of(source, chosen, run_first, ReconstructionGraph)
    return with_reflection(result, source, chosen.settings, run_graphs, passes[0])


def _speed_of(source: Source, chosen: Settled, run_graphs: Run, graph_of: GraphOf) -> Reconstruction:
    """Like ``run_reconstruction``, without the reflection image."""
    dataset, settings, waves = source.dataset(), chosen.settings, chosen.waves
    count = pairs.count(dataset, settings)
    trials: tuple[Candidate, ...] = ()
    before = after = 0
    refinement = None
    if waves is not None:
        refinement = Refinement(source, waves.scale, waves.settings, waves.whole_minutes)
        after = refinement.total if waves.allowed else refinement.passes
    if settings.selects_model:
        settings, trials, before = select_model(source, settings, count // 2, run_graphs, after)
    scan = Scan(source, settings)
    graphs = [graph_of(scan, index) for index in range(count)]
    run_graphs(graphs, before, after)
    reasons = {
        **chosen.reasons,
        **reasons_of_model(settings, chosen.settings, explain_candidates(trials)),
    }
    decided = {
        "geometry": geometry_summary(dataset, settings, scan.problem(count // 2), chosen.reasons),
        "automatic": in_sentences(reasons),
        "noise": f"{1e9 * travel_time_noise(dataset):.0f} ns",
    }
    rays = _assembled(dataset, settings, scan.problem(0), graphs, trials)
    said = {name: text for name, text in decided.items() if text}
    rays = replace(rays, provenance={**rays.provenance, **said})
    done = before + sum(graph.total for graph in graphs)
    if waves is None or refinement is None:
        return rays
    if waves.allowed:
        return refinement.refined(rays, run_graphs, done)
    return refinement.advised(rays, travel_time_noise(dataset), run_graphs, done)


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
    losses = [value for graph in graphs if (value := graph.value_of(solve_attenuation)) is not None]
    spread = [graph.value_of(estimate_uncertainty) for graph in graphs]
    complete = all(item is not None for item in spread)
    held_out = np.sum([np.zeros(3), *(value.held_out for value in losses)], axis=0)
    experimental = {}
    if losses:
        experimental["attenuation"] = "; ".join(filter(None, (EXPERIMENTAL, held_out_amplitudes(held_out))))
    speed = image([1.0 / state.slowness for state in states])
    coverage = image([state.coverage for state in states])
    residuals, history = np.sum([state.residuals for state in states], axis=0), progress_of(graphs).history
    bounds, water = settings.speed_bounds_mps, dataset.water_speed_mps
    cautions = [*bound_cautions(speed, coverage, bounds, water)]
    cautions += fit_cautions(dataset, settings, residuals, history)
    if complete and any(item.caution for item in spread):
        cautions.append(Caution("uncertainty", _of_slices([item.caution for item in spread])))
    cautions += attenuation_cautions(held_out, max((value.guided for value in losses), default=0.0))
    return Reconstruction(
        speed=speed,
        coverage=coverage,
        spacing_m=spacing,
        origin_m=origin,
        water_speed_mps=water,
        settings=settings,
        history=history,
        attenuation=image([value.image for value in losses]) if losses else None,
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

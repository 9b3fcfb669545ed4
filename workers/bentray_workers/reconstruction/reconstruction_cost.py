"""CPU time of a reconstruction, estimated from its counted work and speeds measured on a core of 2020.

The count is exact enough to compare jobs of one class with each other; the speeds are orders of magnitude.
The service multiplies the estimate by the measured time of earlier jobs of the same class.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from bentray_kernels.tomography.model_selection.finite_frequency_candidates import WIDE
from bentray_kernels.tomography.model_selection.selection import (
    CANDIDATES,
    candidate_settings,
    final_settings,
)
from bentray_kernels.tomography.settings import DEVIATION, Settings

from ..files.dataset.counts import Summary
from .ray_sizes import emitters_of, problems_of, shape_of
from .trace_sizes import reflection_seconds
from .waveform_memory import budgeted, wave_minutes

# Node visits of a core in a second, see ``_visits``: 256 emitters on 128 x 128 nodes take 0.96 ms an emitter
# with SART and 7 ms with Gauss-Newton (benchmarks/results/distributed.json).
VISITS_PER_S: Mapping[str, float] = MappingProxyType({"sart": 6.8e7, "gauss-newton": 9.3e6})

# Samples of traces that a core examines and picks in a second.
SAMPLES_PER_S = 1.3e7

# Start, final image and file of any reconstruction, s.
OVERHEAD_S = 1.0


@dataclass(frozen=True)
class ReconstructionCost:
    """Estimated cost of a reconstruction.

    Attributes:
        work_class: jobs of one class take times in proportion to their ``seconds``.
        seconds: on this number of workers, each with a core of 2020.
        speed_known: whether the speeds of this class were measured; if not, ``seconds`` are proportional to
            the work, and only earlier jobs tell the factor.
    """

    work_class: str
    seconds: float
    speed_known: bool


def reconstruction_cost(scan: Summary, settings: Settings, workers: int) -> ReconstructionCost:
    """The cost of a reconstruction, counted without reading the scan.

    Args:
        scan: the dataset.
        settings: with nodes and decomposition.
        workers: that run it; 0 counts as one.
    """
    # Candidates of 3-D arrays are validated by times alone.
    traces = None if scan.in_space and settings.method == "auto" else scan.traces
    waves = 60.0 * wave_minutes(
        traces, scan.width_m, scan.slices, budgeted(traces, scan.width_m, scan.slices, settings)
    )
    rays = _rays_seconds(scan, settings)
    picking = 0.0
    if (recorded := scan.recorded) is not None:
        samples = 2.0 * scan.slices * recorded.emissions * recorded.receivers * recorded.samples
        picking = samples / SAMPLES_PER_S
    sequential = settings.method == "sart"
    at_once = max(1, min(workers, problems_of(scan, settings)) if sequential else workers)
    parallel = picking + waves + reflection_seconds(scan, settings)
    seconds = OVERHEAD_S + rays / at_once + parallel / max(1, workers)
    return ReconstructionCost(_class(scan, settings, waves > 0.0), seconds, _speed_known(settings))


def _class(scan: Summary, settings: Settings, waves: bool) -> str:
    parts: list[str] = [settings.method, settings.rays, settings.decomposition or "slices", settings.eikonal]
    if scan.traces_bytes:
        parts.append(settings.picking.picker)
    if waves:
        parts.append("waves")
    if settings.selects_model and scan.period:
        parts.append("finite-frequency")
    if settings.reflection.enabled:
        parts.append("reflection")
    if settings.numerics.blocks > 1:
        parts.append("blocks")
    return " ".join(parts)


def _speed_known(settings: Settings) -> bool:
    return settings.decomposition != "volume" and settings.eikonal == DEVIATION


def _rays_seconds(scan: Summary, settings: Settings) -> float:
    """CPU time of everything along rays, s."""
    if not settings.selects_model:
        return _method_seconds(scan, settings)
    wide = scan.period and settings.decomposition != "volume"
    # With a known frequency the usual trials; the most costly reconstruction is the final one.
    candidates = (*WIDE, WIDE[1]) if wide else CANDIDATES
    if settings.rays == "straight":
        candidates = tuple(one for one in candidates if one["rays"] == "straight")
    final = final_settings(settings, {"rays": settings.rays, "method": "gauss-newton"})
    trials = sum(_problem_seconds(scan, one) for one in candidate_settings(settings, candidates))
    return trials + _method_seconds(scan, final)


def _method_seconds(scan: Summary, settings: Settings) -> float:
    return problems_of(scan, settings) * _problem_seconds(scan, settings)


def _problem_seconds(scan: Summary, settings: Settings) -> float:
    """CPU time of all stages of one slice, or of a volume, by one method, s."""
    numerics = settings.numerics
    grids = [-(-settings.grid_nodes // 2**k) for k in range(numerics.coarser_grids + 1)]
    visits = sum(settings.iterations * _visits(scan, settings, nodes) for nodes in grids)
    seconds = visits / VISITS_PER_S[settings.method]
    further = int(settings.attenuation.enabled and scan.amplitudes) + int(settings.resolution_check)
    # Rays are traced once more, unless Gauss-Newton has them; eight probes cost a fifth of that.
    again = 0.2 if settings.method == "gauss-newton" and settings.rays == "curved" else 1.2
    passes = further + again * settings.estimates_uncertainty
    return seconds + passes * _visits(scan, settings, settings.grid_nodes) / VISITS_PER_S["gauss-newton"]


def _visits(scan: Summary, settings: Settings, nodes: int) -> float:
    """Nodes visited in one iteration: by the wave front of each emitter, and by its rays."""
    image = math.prod(shape_of(scan, settings.changed(nodes=nodes, coarser_grids=0)))
    front = 1 if settings.rays == "straight" else 2
    return float(emitters_of(scan, settings) * (front * image + scan.receivers * nodes))

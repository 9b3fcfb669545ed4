"""Choice of rays and method by held-out validation: candidates must predict pairs they were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ...acquisition import Dataset
from ...errors import InvalidInput
from .. import pairs
from ..grid_schedule import stages
from ..reconstruction_graph import Run
from ..result import Reconstruction, Trial
from ..settings import Settings
from ..stage_graphs import Scan
from ..stopping import stop_at_noise, travel_time_noise
from .candidates import CandidateGraph
from .finite_frequency_candidates import (
    STRAIGHT,
    choose_finite_frequency,
    finite_frequency_candidates,
    mean_misfit,
    mean_time,
)
from .held_out import Part

PAIRS: tuple[Part, Part] = ("shown", "held-out")
VIEWS: tuple[Part, Part] = ("shown-views", "held-out-views")

# Candidates with thin rays: bent ones lose where picked times are not solutions of the Eikonal equation.
CANDIDATES: tuple[dict[str, Any], ...] = (
    {"rays": "straight", "method": "sart"},
    {"rays": "straight", "method": "gauss-newton"},
    {"rays": "curved", "method": "sart"},
    {"rays": "curved", "method": "sart", "front_smoothing_nodes": 4.0},
    {"rays": "curved", "method": "gauss-newton"},
    {"rays": "curved", "method": "gauss-newton", "edge_mps": 7.0},
)

# The same for a known frequency where finite-frequency rays do not explain the times: straight rays by SART
# alone, which fits less closely. Gauss–Newton predicts scattered pairs better, but its image is worse (33
# against 27 m/s).
BANDED: tuple[dict[str, Any], ...] = tuple(
    changes for changes in CANDIDATES if changes != {"rays": "straight", "method": "gauss-newton"}
)

# Candidates are reconstructed on half the nodes, but not fewer than this.
TRIAL_NODES = 64

# Bent rays must predict held-out pairs this much better than straight ones, the simpler model. On a wave
# simulation whose bent image was 2 m/s worse than the straight one the ratio was 0.95; on Eikonal times
# from 0.9 (water faster than a fat ring) down to 0.35.
CLEARLY = 0.92


def candidate_settings(
    settings: Settings, candidates: Sequence[dict[str, Any]] = CANDIDATES
) -> list[Settings]:
    """The settings of each candidate, on a coarser grid."""
    nodes = min(settings.nodes, max(TRIAL_NODES, -(-settings.nodes // 2)))
    coarser = nodes / settings.nodes
    plans = []
    for changes in candidates:
        plan = settings.changed(**changes, attenuation=False, resolution_check=False)
        front = plan.numerics.front_smoothing_nodes * coarser
        # An image of half the nodes has half the edge nodes for the same rays.
        strength = plan.gauss_newton.penalty_strength * (coarser if plan.numerics.ray_width_m > 0.0 else 1.0)
        plans.append(
            plan.changed(nodes=nodes, coarser_grids=0, front_smoothing_nodes=front, penalty_strength=strength)
        )
    return plans


def select_model(
    dataset: Dataset,
    settings: Settings,
    index: int,
    scan_of: Callable[[Settings, Part], Scan],
    run_graphs: Run,
    after: int = 0,
) -> tuple[Settings, tuple[Trial, ...], int]:
    """The settings that predict held-out pairs of one slice best, and the results of all candidates.

    Where the frequency is known, finite-frequency rays are tried first, straight and bent, on held-out views,
    see ``choose_finite_frequency``. Otherwise, or where these rays do not explain the times, thin rays are
    tried on held-out pairs, see ``choose``. The reconstruction then stops at the noise of the times
    (discrepancy principle of Morozov), unless the candidate shows that the noise is lower.

    Args:
        dataset: for its frequency and the noise of its times.
        settings: with an automatic choice of rays and method.
        index: of the slice.
        scan_of: makes a scan of a part of the pairs.
        run_graphs: runs graphs to their end.
        after: emitter passes that come after the reconstruction, at most.

    Returns:
        The settings; the trials, the chosen one first and the others by their misfit; and the emitter passes
        that they took.

    Raises:
        InvalidInput: for a slice without pairs, or with too few to hold some out.
    """
    wide = finite_frequency_candidates(dataset, settings)
    thin = BANDED if wide else CANDIDATES
    rest = passes_to_come(dataset, settings) + after
    trials: list[Trial] = []
    chosen, before = None, 0
    if wide and not _missing_part(VIEWS, settings, index, scan_of):
        graphs = _graphs(settings, wide, index, VIEWS, scan_of)
        thin_passes = sum(graph.total for graph in _graphs(settings, thin, index, PAIRS, scan_of))
        run_graphs(graphs, 0, thin_passes + rest)
        trials, before = _trials(wide, graphs), sum(graph.total for graph in graphs)
        chosen = choose_finite_frequency(trials, mean_time(dataset))
    if chosen is None:
        _check_parts(settings, index, scan_of)
        graphs = _graphs(settings, thin, index, PAIRS, scan_of)
        run_graphs(graphs, before, rest)
        trials, before = _trials(thin, graphs), before + sum(graph.total for graph in graphs)
        chosen = choose(trials)
    others = sorted((t for t in trials if t is not chosen), key=lambda trial: trial.held_out_rms_s)
    selected = settings.changed(**chosen.settings)
    return stop_at_noise(selected, chosen, travel_time_noise(dataset)), (chosen, *others), before


def _graphs(
    settings: Settings,
    candidates: Sequence[dict[str, Any]],
    index: int,
    parts: tuple[Part, Part],
    scan_of: Callable[[Settings, Part], Scan],
) -> list[CandidateGraph]:
    training, held_out = parts
    plans = candidate_settings(settings, candidates)
    return [CandidateGraph(scan_of(plan, training), index, scan_of(plan, held_out)) for plan in plans]


def _trials(candidates: Sequence[dict[str, Any]], graphs: Sequence[CandidateGraph]) -> list[Trial]:
    return [
        Trial(changes, graph.held_out_rms_s, graph.history[-1].residual_rms_s, graph.held_out_mean_s)
        for changes, graph in zip(candidates, graphs, strict=True)
    ]


def passes_to_come(dataset: Dataset, settings: Settings) -> int:
    """Emitter passes that a reconstruction takes at most, whichever candidate is chosen."""
    every = (*CANDIDATES, *finite_frequency_candidates(dataset, settings))
    plans = [stages(dataset, settings.changed(**changes)) for changes in every]
    each = max(sum(plan.iterations for plan in grids) for grids in plans)
    each += settings.attenuation.enabled and dataset.log_ratio_np is not None
    each += settings.resolution_check
    problems = range(pairs.count(dataset, settings))
    return each * sum(len(pairs.of(dataset, settings, index).emitters) for index in problems)


def _check_parts(settings: Settings, index: int, scan_of: Callable[[Settings, Part], Scan]) -> None:
    plan = candidate_settings(settings)[0]
    scan_of(plan, "all").problem(index)
    if part := _missing_part(PAIRS, settings, index, scan_of):
        accepted = f"sart or gauss-newton, for slice {index} has no pair that is {part}"
        raise InvalidInput("method", repr(settings.method), accepted)


def _missing_part(
    parts: Sequence[Part], settings: Settings, index: int, scan_of: Callable[[Settings, Part], Scan]
) -> Part | None:
    """The first part without any pair of the slice; None if every part has some."""
    for part in parts:
        try:
            scan_of(candidate_settings(settings)[0], part).problem(index)
        except InvalidInput:
            return part
    return None


def choose(trials: Sequence[Trial]) -> Trial:
    """The trial with the lowest misfit; one with straight rays unless bent ones are clearly better."""
    best = min(trials, key=lambda trial: trial.held_out_rms_s)
    straight = min(
        (trial for trial in trials if trial.settings["rays"] == "straight"),
        key=lambda trial: trial.held_out_rms_s,
    )
    return best if best.held_out_rms_s < CLEARLY * straight.held_out_rms_s else straight


def explain_trials(trials: Sequence[Trial]) -> str:
    """One sentence: the chosen candidate, the rule, and the misfits of all; empty without trials."""
    if not trials:
        return ""
    wide = [trial for trial in trials if "ray_width_m" in trial.settings]
    misfits = [mean_misfit(t) if wide else t.held_out_rms_s for t in trials]
    labels = [
        f"{_label(t.settings)} {1e9 * misfit:.0f} ns" for t, misfit in zip(trials, misfits, strict=True)
    ]
    if wide:
        rule = "mean misfit of held-out views, finite-frequency rays"
        if misfits[0] > min(mean_misfit(trial) for trial in wide):
            needed = f"{100.0 * (1.0 - STRAIGHT):.0f} % better"
            rule += f"; where both explain the times, straight rays must be {needed}"
    else:
        rule = "misfit of held-out pairs"
        if misfits[0] > min(misfits):
            rule += f"; bent rays must be {100.0 * (1.0 - CLEARLY):.0f} % better"
    return f"auto chose {labels[0]} ({rule}); the others: {', '.join(labels[1:])}"


def advice_of(result: Reconstruction) -> str:
    """How the model of a result was chosen, and what a full-waveform refinement gave or would give."""
    parts = explain_trials(result.trials), result.provenance.get("waveform", "")
    return "; ".join(part for part in parts if part)


def _label(changes: dict[str, Any]) -> str:
    """As ``straight sart`` or ``curved sart (front_smoothing_nodes 4)``."""
    more = [f"{name} {value:g}" for name, value in changes.items() if name not in ("rays", "method")]
    plain = " ".join(str(changes[name]) for name in ("rays", "method") if name in changes)
    return f"{plain} ({', '.join(more)})" if more else plain

"""Choice of rays and method by held-out validation: candidates must predict pairs they were not fitted to."""

from __future__ import annotations

import math
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
    EXACT,
    STRAIGHT,
    choose_finite_frequency,
    finite_frequency_candidates,
    mean_misfit,
    mean_time,
)
from .held_out import Part

PAIRS: tuple[Part, Part] = ("shown", "held-out")
VIEWS: tuple[Part, Part] = ("shown-views", "held-out-views")

# Candidates with thin rays: bent ones lose where picked times are not solutions of the Eikonal equation. The
# cheapest of each kind are tried first.
CHEAPEST: tuple[dict[str, Any], ...] = (
    {"rays": "straight", "method": "sart"},
    {"rays": "curved", "method": "sart"},
)
OTHER_BENT: tuple[dict[str, Any], ...] = (
    {"rays": "curved", "method": "sart", "front_smoothing_nodes": 4.0},
    {"rays": "curved", "method": "gauss-newton"},
)

# Not where the frequency is known and finite-frequency rays do not explain the times: Gauss-Newton predicts
# scattered pairs better than SART, which fits less closely, but its image is worse (33 against 27 m/s).
STRAIGHT_LINES: tuple[dict[str, Any], ...] = ({"rays": "straight", "method": "gauss-newton"},)

# Tried where bent rays are clearly better: exact times allow a weaker penalty, phantoms of flat parts sharper
# edges. These cost several times as much as SART.
SHARPER: tuple[dict[str, Any], ...] = (
    {"rays": "curved", "method": "gauss-newton", "penalty_strength": 0.1},
    {"rays": "curved", "method": "gauss-newton", "edge_mps": 7.0},
)
CANDIDATES = (*CHEAPEST, *STRAIGHT_LINES, *OTHER_BENT, *SHARPER)

# Candidates are reconstructed on half the nodes, but not fewer than this.
TRIAL_NODES = 48

# Bent rays must predict held-out pairs this much better than straight ones, the simpler model, and sharper
# images than smoother ones. On a wave simulation whose bent image was 2 m/s worse than the straight one the
# ratio was 0.95; on Eikonal times from 0.9 (water faster than a fat ring) down to 0.35.
CLEARLY = 0.92

# Thin bent rays start on coarser grids, each of half the nodes of the next, down to this many nodes.
COARSEST_NODES = 32

# Without enough pairs to hold some out.
UNVALIDATED: dict[str, Any] = {"rays": "curved", "method": "sart"}


def candidate_settings(
    settings: Settings, candidates: Sequence[dict[str, Any]] = CANDIDATES
) -> list[Settings]:
    """The settings of each candidate, on a coarser grid."""
    nodes = min(settings.grid_nodes, max(TRIAL_NODES, -(-settings.grid_nodes // 2)))
    coarser = nodes / settings.grid_nodes
    plans = []
    for changes in candidates:
        plan = settings.changed(**changes, attenuation=False, resolution_check=False, uncertainty=False)
        front = plan.numerics.front_smoothing_nodes * coarser
        # An image of half the nodes has half the edge nodes for the same rays.
        strength = plan.gauss_newton.penalty_strength * (coarser if plan.numerics.ray_width_m > 0.0 else 1.0)
        plan = plan.changed(
            nodes=nodes, coarser_grids=0, front_smoothing_nodes=front, penalty_strength=strength
        )
        plans.append(_from_coarser_grids(plan))
    return plans


def final_settings(settings: Settings, changes: dict[str, Any]) -> Settings:
    """The settings of the reconstruction by a candidate: thin bent rays start on coarser grids."""
    chosen = settings.changed(**changes)
    return chosen if chosen.numerics.coarser_grids else _from_coarser_grids(chosen)


def _from_coarser_grids(settings: Settings) -> Settings:
    """The same on coarser grids first, for thin bent rays: on one grid they keep to wrong paths."""
    if settings.rays == "straight" or settings.numerics.ray_width_m > 0.0:
        return settings
    grids = 0
    while settings.grid_nodes >> (grids + 1) >= COARSEST_NODES:
        grids += 1
    return settings.changed(coarser_grids=grids)


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
    tried on held-out pairs, see ``next_candidates`` and ``choose``.
    The reconstruction then stops at the noise of the times (discrepancy principle of Morozov), unless the
    candidate shows that the noise is lower.

    Args:
        dataset: for its frequency and the noise of its times.
        settings: with an automatic choice of rays and method.
        index: of the slice.
        scan_of: makes a scan of a part of the pairs.
        run_graphs: runs graphs to their end.
        after: emitter passes that come after the reconstruction, at most.

    Returns:
        The settings; the trials, the chosen one first and the others by their misfit, none with too few pairs
        to hold some out; and the emitter passes that they took.

    Raises:
        InvalidInput: for a slice without pairs.
    """
    wide = finite_frequency_candidates(dataset, settings)
    rest = passes_to_come(dataset, settings) + after
    trials: list[Trial] = []
    chosen, before = None, 0

    def graphs_of(candidates: Sequence[dict[str, Any]], parts: tuple[Part, Part]) -> list[CandidateGraph]:
        return _graphs(settings, candidates, index, parts, scan_of)

    def run(
        candidates: Sequence[dict[str, Any]], graphs: Sequence[CandidateGraph], later: int
    ) -> list[Trial]:
        nonlocal before
        run_graphs(graphs, before, later + rest)
        before += sum(graph.total for graph in graphs)
        return _trials(candidates, graphs)

    missing = _missing_part(PAIRS, settings, index, scan_of)
    allowed = [one for one in CANDIDATES if settings.rays == "curved" or one["rays"] == "straight"]
    thin = dict(zip(map(label, allowed), graphs_of(allowed, PAIRS), strict=True)) if not missing else {}

    if wide and not _missing_part(VIEWS, settings, index, scan_of):
        tried = wide if settings.rays != "straight" else wide[:1]
        trials = run(tried, graphs_of(tried, VIEWS), sum(graph.total for graph in thin.values()))
        chosen = trials[0] if len(trials) == 1 else choose_finite_frequency(trials, mean_time(dataset))
    if chosen is None:
        if missing:
            return final_settings(settings, {**UNVALIDATED, "rays": settings.rays}), (), before
        trials = []
        while following := next_candidates(trials, settings.rays, known_frequency=bool(wide)):
            graphs = [thin.pop(label(one)) for one in following]
            trials += run(following, graphs, sum(graph.total for graph in thin.values()))
        chosen = choose(trials)
    others = sorted((t for t in trials if t is not chosen), key=lambda trial: trial.held_out_rms_s)
    selected = final_settings(settings, chosen.settings)
    return stop_at_noise(selected, chosen, travel_time_noise(dataset)), (chosen, *others), before


def next_candidates(
    trials: Sequence[Trial], rays: str, *, known_frequency: bool
) -> tuple[dict[str, Any], ...]:
    """The candidates that can still be chosen, the cheap ones before the costly ones; empty at the end.

    Where bent SART has no lower misfit than straight SART, bent Gauss-Newton decides whether bent rays are
    tried further: in water that is faster than a thick layer of fat, few iterations of SART do not find the
    ways around it. Otherwise the sharper candidates are next, which were the best on every scan with times
    of the Eikonal equation; others only if those are not clearly better than bent and straight rays.

    Args:
        trials: so far.
        rays: ``straight`` if straight rays are requested: bent ones are not tried.
        known_frequency: whether SART is the only method with straight rays.
    """
    lines = () if known_frequency else STRAIGHT_LINES
    rounds: tuple[tuple[dict[str, Any], ...], ...] = ((*CHEAPEST[:1], *lines),)
    if rays != "straight":
        rounds = (CHEAPEST,)
        if trials:
            straight, bent = (_trial_of(one, trials).held_out_rms_s for one in CHEAPEST)
            if bent >= straight:
                lowest = min(_rms(trial) for trial in trials if not _bent(trial))
                further = any(t.settings == OTHER_BENT[-1] and _rms(t) < lowest for t in trials)
                rounds = (lines, OTHER_BENT[-1:], SHARPER if further else ())
            elif bent >= CLEARLY * straight:
                rounds = (lines, SHARPER, OTHER_BENT)
            else:
                rounds = (SHARPER, (*lines, *OTHER_BENT))
            if choose(trials).settings in SHARPER:
                return ()
    return next((part for part in rounds if not _tried(part, trials)), ())


def _tried(candidates: Sequence[dict[str, Any]], trials: Sequence[Trial]) -> bool:
    """Whether there is a trial of each."""
    return all(any(trial.settings == one for trial in trials) for one in candidates)


def _trial_of(candidate: dict[str, Any], trials: Sequence[Trial]) -> Trial:
    return next(trial for trial in trials if trial.settings == candidate)


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
    plans = [stages(dataset, final_settings(settings, changes)) for changes in every]
    each = max(sum(plan.iterations for plan in grids) for grids in plans)
    each += settings.attenuation.enabled and dataset.log_ratio_np is not None
    each += settings.resolution_check + settings.uncertainty
    problems = range(pairs.count(dataset, settings))
    return each * sum(len(pairs.of(dataset, settings, index).emitters) for index in problems)


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
    """The trial with the lowest misfit; straight rays unless bent ones are clearly better.

    Sharper candidates must be clearly better than other bent rays, and than straight rays twice as clearly:
    noise in the times becomes structure more easily with these.
    """
    sharper = [trial for trial in trials if trial.settings in SHARPER]
    simple = [trial for trial in trials if trial not in sharper]
    best, straight = min(simple, key=_rms), min((t for t in simple if not _bent(t)), key=_rms)
    bent = min((_rms(trial) for trial in simple if _bent(trial)), default=math.inf)
    if sharper:
        sharpest = min(sharper, key=_rms)
        if _rms(sharpest) < CLEARLY * min(bent, CLEARLY * _rms(straight)):
            return sharpest
    return best if _rms(best) < CLEARLY * _rms(straight) else straight


def _bent(trial: Trial) -> bool:
    return bool(trial.settings["rays"] != "straight")


def _rms(trial: Trial) -> float:
    """Root mean square misfit of the held-out pairs, s."""
    return trial.held_out_rms_s


def explain_trials(trials: Sequence[Trial]) -> str:
    """One sentence: the chosen candidate, and why; empty without trials."""
    if not trials:
        return ""
    chosen, misfit = trials[0], _misfit_of(trials)
    wide = [trial for trial in trials if "ray_width_m" in trial.settings]
    what = "held-out views" if wide else "held-out pairs"
    others = [t for t in wide or trials if t.settings["rays"] != chosen.settings["rays"]]
    if not others:
        return f"auto chose {label(chosen.settings)}: the only candidate"
    gain = 1.0 - misfit(chosen) / min(map(misfit, others))
    if chosen.settings["rays"] == "straight":
        reason = f"bent rays do not predict {what} better"
        if gain < 0.0:
            reason = f"bent rays must predict {what} {100.0 * (1.0 - CLEARLY):.0f} % better"
    else:
        reason = f"{100.0 * gain:.0f} % better than straight rays at predicting {what}"
        if gain < 0.0:
            reason = f"straight rays must predict {what} {100.0 * (1.0 - STRAIGHT):.0f} % better"
    return f"auto chose {label(chosen.settings)}: {reason}"


def trial_table(trials: Sequence[Trial]) -> list[tuple[str, str, str]]:
    """Rows of a table of candidates: label, misfit of held-out pairs, and ``chosen`` or ``rejection``."""
    misfit = _misfit_of(trials)
    return [
        (
            label(trial.settings),
            f"{1e9 * misfit(trial):.0f} ns",
            "chosen" if k == 0 else rejection(trial, trials),
        )
        for k, trial in enumerate(trials)
    ]


def rejection(trial: Trial, trials: Sequence[Trial]) -> str:
    """Why a candidate with a lower misfit than the chosen one, the first, was not chosen; else empty."""
    chosen, misfit = trials[0], _misfit_of(trials)
    if trial is chosen or misfit(trial) >= misfit(chosen):
        return ""
    bent, wide = _bent(trial), "ray_width_m" in chosen.settings
    if wide and "ray_width_m" not in trial.settings:
        part, why = EXACT, "thin rays fit wrong picks too"
    elif not bent:
        part, why = STRAIGHT, "straight rays fit smooth times with a wrong image"
    elif trial.settings in SHARPER:
        return "not clearly lower: sharper images also show the noise"
    else:
        part, why = CLEARLY, "the simpler model is kept"
    return f"must be below {1e9 * part * misfit(chosen):.0f} ns: {why}"


def _misfit_of(trials: Sequence[Trial]) -> Callable[[Trial], float]:
    """The misfit that decides: the mean one where finite-frequency rays were tried, else the rms."""
    wide = any("ray_width_m" in trial.settings for trial in trials)
    return mean_misfit if wide else lambda trial: trial.held_out_rms_s


def advice_of(result: Reconstruction) -> str:
    """How the model of a result was chosen, and what a full-waveform refinement gave or would give."""
    parts = explain_trials(result.trials), result.provenance.get("waveform", "")
    return "; ".join(part for part in parts if part)


def label(changes: dict[str, Any]) -> str:
    """As ``straight rays, SART`` or ``bent finite-frequency rays, Gauss-Newton``."""
    rays = "straight" if changes["rays"] == "straight" else "bent"
    wide = " finite-frequency" if changes.get("ray_width_m") else ""
    parts = [f"{rays}{wide} rays"]
    if "method" in changes:
        parts.append({"sart": "SART", "gauss-newton": "Gauss-Newton"}[changes["method"]])
    if changes.get("front_smoothing_nodes"):
        parts.append("smoothed wave front")
    if changes.get("edge_mps"):
        parts.append("sharp edges")
    if "penalty_strength" in changes and not wide:
        parts.append(f"penalty {changes['penalty_strength']:g}")
    return ", ".join(parts)

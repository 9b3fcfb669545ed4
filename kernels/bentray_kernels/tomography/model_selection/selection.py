"""Choice of rays and method by held-out validation: candidates must predict pairs they were not fitted to."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from ...acquisition import Dataset
from ...errors import InvalidInput
from .. import pairs
from ..grid_schedule import stages
from ..held_out import Part
from ..reconstruction_graph import Run
from ..result import Candidate, Reconstruction
from ..scan import Scan, Source
from ..settings import Settings
from ..stopping import stop_at_noise
from .candidates import CandidateGraph
from .finite_frequency_candidates import (
    EXACT,
    STRAIGHT,
    choose_finite_frequency,
    finite_frequency_candidates,
    mean_misfit,
    mean_time,
)

# Training part, then held-out parts: of thin rays, and of finite-frequency rays.
PARTS: tuple[Part, ...] = ("shown", "held-out", "views")
SPARSE_PARTS: tuple[Part, ...] = ("shown-sparse", "views-sparse")

# Candidates with thin rays. Bent ones lose where picked times are not solutions of the Eikonal equation;
# exact times allow a weaker penalty, flat parts sharper edges. Bent SART is none of them: where bent rays are
# right, bent Gauss-Newton predicts held-out pairs better, and its image is better.
CANDIDATES: tuple[dict[str, Any], ...] = (
    {"rays": "straight", "method": "sart"},
    {"rays": "straight", "method": "gauss-newton"},
    {"rays": "curved", "method": "gauss-newton"},
    {"rays": "curved", "method": "gauss-newton", "penalty_strength": 0.1},
    {"rays": "curved", "method": "gauss-newton", "edge_mps": 7.0},
)

# Candidates are reconstructed on half the nodes, but not fewer than this.
CANDIDATE_NODES = 48

# Thin bent rays start on coarser grids, each of half the nodes of the next, down to this many nodes.
COARSEST_NODES = 32

# Candidates and their graphs.
Graphs = list[tuple[dict[str, Any], CandidateGraph]]

# Without enough pairs to hold some out.
UNVALIDATED: dict[str, Any] = {"rays": "curved", "method": "sart"}


def candidate_settings(
    settings: Settings, candidates: Sequence[dict[str, Any]] = CANDIDATES
) -> list[Settings]:
    """The settings of each candidate, on a coarser grid."""
    nodes = min(settings.grid_nodes, max(CANDIDATE_NODES, -(-settings.grid_nodes // 2)))
    coarser = nodes / settings.grid_nodes
    plans = []
    for changes in candidates:
        plan = settings.changed(**changes, attenuation=False, resolution_check=False, uncertainty=False)
        # An image of half the nodes has half the edge nodes for the same rays.
        strength = plan.gauss_newton.penalty_strength * (coarser if plan.numerics.ray_width_m > 0.0 else 1.0)
        plan = plan.changed(nodes=nodes, coarser_grids=0, penalty_strength=strength)
        plans.append(_from_coarser_grids(plan))
    return plans


def final_settings(settings: Settings, changes: dict[str, Any]) -> Settings:
    """The settings of the reconstruction by a candidate: thin bent rays start on coarser grids."""
    chosen = settings.changed(**changes)
    return chosen if chosen.numerics.coarser_grids else _from_coarser_grids(chosen)


def _from_coarser_grids(settings: Settings) -> Settings:
    """These settings with coarser grids first, for thin bent rays: on one grid they keep to wrong paths."""
    if settings.rays == "straight" or settings.numerics.ray_width_m > 0.0:
        return settings
    grids = 0
    while settings.grid_nodes >> (grids + 1) >= COARSEST_NODES:
        grids += 1
    return settings.changed(coarser_grids=grids)


def select_model(
    source: Source,
    settings: Settings,
    index: int,
    run_graphs: Run,
    after: int = 0,
) -> tuple[Settings, tuple[Candidate, ...], int]:
    """The settings that predict held-out pairs of one slice best, and the results of all candidates.

    Where the frequency is known, finite-frequency rays are tried first, straight and bent, on held-out views,
    see ``choose_finite_frequency``. Otherwise, or where these rays do not explain the times, thin rays are
    tried on scattered pairs and views; the lowest root mean square misfit is chosen. All candidates
    predict the same times, so that the noise of these adds the same to each mean square.
    The reconstruction then stops at the noise of the times (discrepancy principle of Morozov), unless the
    candidate shows that the noise is lower.

    Args:
        source: of the scan.
        settings: with an automatic choice of rays and method.
        index: of the slice.
        run_graphs: runs graphs to their end.
        after: emitter passes that come after the reconstruction, at most.

    Returns:
        The settings; the candidates, the chosen one first and the others by their misfit, none with too few
        pairs to hold some out; and the emitter passes that they took.

    Raises:
        InvalidInput: for a slice without pairs.
    """
    dataset = source.dataset()
    rest = passes_to_come(dataset, settings) + after
    before = 0

    def graph_of(plan: Settings, shown: Part, held: Sequence[Part]) -> CandidateGraph:
        return CandidateGraph(Scan(source, plan, shown), index, *(Scan(source, plan, part) for part in held))

    def graphs_of(candidates: Sequence[dict[str, Any]], parts: Sequence[Part]) -> Graphs:
        """The candidates with the requested rays; none without training or held-out pairs."""
        first = candidate_settings(settings)[0]
        held = [part for part in parts[1:] if _has_pairs(Scan(source, first, part), index)]
        if not held or not _has_pairs(Scan(source, first, parts[0]), index):
            return []
        curved = settings.rays == "curved"
        tried = [changes for changes in candidates if curved or changes["rays"] == "straight"]
        plans = zip(tried, candidate_settings(settings, tried), strict=True)
        return [(changes, graph_of(plan, parts[0], held)) for changes, plan in plans]

    def run(tried: Graphs, later: int = 0) -> list[Candidate]:
        nonlocal before
        graphs = [graph for _, graph in tried]
        run_graphs(graphs, before, later + rest)
        before += sum(graph.total for graph in graphs)
        misfits = [graph.misfits() for graph in graphs]
        return [
            Candidate(changes, rms, graph.history[-1].residual_rms_s, mean)
            for (changes, graph), (rms, mean) in zip(tried, misfits, strict=True)
        ]

    thin = graphs_of(CANDIDATES, PARTS)
    chosen = None
    wide = finite_frequency_candidates(dataset, settings)
    if wide and (tried := graphs_of(wide, SPARSE_PARTS)):
        candidates = run(tried, sum(graph.total for _, graph in thin))
        chosen = choose_finite_frequency(candidates, mean_time(dataset))
    if chosen is None:
        if not thin:
            return final_settings(settings, {**UNVALIDATED, "rays": settings.rays}), (), before
        tried, candidates = thin, run(thin)
        chosen = min(candidates, key=lambda candidate: candidate.held_out_rms_s)
    others = sorted((t for t in candidates if t is not chosen), key=lambda t: t.held_out_rms_s)
    selected = final_settings(settings, chosen.settings)
    # Scattered pairs, if there are any: errors of the model are larger in views.
    misfit = next(graph.misfits(1)[0] for changes, graph in tried if changes is chosen.settings)
    return stop_at_noise(selected, misfit, dataset), (chosen, *others), before


def _has_pairs(scan: Scan, index: int) -> bool:
    try:
        scan.problem(index)
    except InvalidInput:
        return False
    return True


def passes_to_come(dataset: Dataset, settings: Settings) -> int:
    """Emitter passes that a reconstruction takes at most, whichever candidate is chosen."""
    every = (*CANDIDATES, *finite_frequency_candidates(dataset, settings))
    plans = [stages(dataset, final_settings(settings, changes)) for changes in every]
    each = max(sum(plan.iterations for plan in grids) for grids in plans)
    each += settings.attenuation.enabled and dataset.log_ratio_np is not None
    each += settings.resolution_check + settings.estimates_uncertainty
    problems = range(pairs.count(dataset, settings))
    return each * sum(len(pairs.from_dataset(dataset, settings, index).emitters) for index in problems)


def explain_candidates(candidates: Sequence[Candidate]) -> str:
    """One sentence: the chosen candidate, and why; empty without candidates."""
    if not candidates:
        return ""
    chosen, misfit = candidates[0], _misfit_of(candidates)
    wide = [candidate for candidate in candidates if "ray_width_m" in candidate.settings]
    what = "held-out views" if wide else "held-out pairs"
    others = [t for t in wide or candidates if t.settings["rays"] != chosen.settings["rays"]]
    if not others:
        return f"auto chose {label(chosen.settings)}: the only candidate"
    gain = 1.0 - misfit(chosen) / min(map(misfit, others))
    if chosen.settings["rays"] == "straight":
        # Earlier versions kept straight rays unless bent ones were better by some per cent.
        reason = f"bent rays do not predict {what} {'better' if gain >= 0.0 else 'clearly better'}"
    else:
        reason = f"{100.0 * gain:.0f} % better than straight rays at predicting {what}"
        if gain < 0.0:
            reason = f"straight rays must predict {what} {100.0 * (1.0 - STRAIGHT):.0f} % better"
    return f"auto chose {label(chosen.settings)}: {reason}"


def choice_table(result: Reconstruction) -> list[dict[str, Any]]:
    """Rows of a table of what ``auto`` compared, the chosen candidate first and full waveforms last.

    Returns:
        For each ``label``; ``held_out_rms_s``, ``held_out_mean_s`` and ``training_rms_s``, None for full
        waveforms; whether it was ``chosen`` among rays, and is the image that is ``shown``; ``outcome``:
        these in words, or one reason why not. Empty without candidates.
    """
    if not result.trials:
        return []
    waves, by_waves = result.provenance.get("waveform", ""), result.settings.method == "waveform"
    rows = [
        {
            "label": label(candidate.settings),
            "held_out_rms_s": candidate.held_out_rms_s,
            "held_out_mean_s": candidate.held_out_mean_s,
            "training_rms_s": candidate.shown_rms_s,
            "chosen": k == 0,
            "shown": k == 0 and not by_waves,
            "outcome": _refusal(candidate, result.trials),
        }
        for k, candidate in enumerate(result.trials)
    ]
    rows[0]["outcome"] = "chosen: full waveforms began with its image" if by_waves else "chosen and shown"
    if waves or by_waves:
        ran = any(record.band_hz for record in result.history)
        state = "shown" if by_waves else "refused" if ran else "not run"
        said = waves.removeprefix("full waveform, ").removeprefix("method waveform ")
        rows.append(
            {
                "label": "full waveform",
                **dict.fromkeys(("held_out_rms_s", "held_out_mean_s", "training_rms_s")),
                "chosen": False,
                "shown": by_waves,
                "outcome": f"{state}: {said}" if said else state,
            }
        )
    return rows


def _refusal(candidate: Candidate, candidates: Sequence[Candidate]) -> str:
    """Why a candidate was not chosen; the chosen one is the first."""
    misfit = _misfit_of(candidates)
    its, least = misfit(candidate), misfit(candidates[0])
    if its >= least:
        worse = "no better"
        if 0.0 < least < its < math.inf:
            excess = 100.0 * (its / least - 1.0)
            worse = f"{max(excess, 0.1):.{0 if excess >= 10.0 else 1}f} % worse"
        return f"refused: predicts what was held out {worse}"
    factor, why = STRAIGHT, "fits smooth times with a wrong image"
    if "ray_width_m" not in candidates[0].settings:
        return "refused: predicts what was held out not clearly better"
    if "ray_width_m" not in candidate.settings:
        factor, why = EXACT, "fits wrong picks as well as right ones"
    return f"refused: {why}: {1e9 * its:.0f} ns held out against {1e9 * factor * least:.0f} allowed"


def criterion(candidates: Sequence[Candidate]) -> str:
    """The misfit of ``choice_table`` that decided; empty without candidates.

    It is the mean one where finite-frequency rays were tried, else the root mean square.
    """
    if not candidates:
        return ""
    wide = any("ray_width_m" in candidate.settings for candidate in candidates)
    return "held_out_mean_s" if wide else "held_out_rms_s"


def _misfit_of(candidates: Sequence[Candidate]) -> Callable[[Candidate], float]:
    wide = criterion(candidates) == "held_out_mean_s"
    return mean_misfit if wide else lambda candidate: candidate.held_out_rms_s


def advice_of(result: Reconstruction) -> str:
    """How the model of a result was chosen, and what a full-waveform refinement gave or would give."""
    advice = explain_candidates(result.trials), result.provenance.get("waveform", "")
    return "; ".join(sentence for sentence in advice if sentence)


def image_label(result: Reconstruction) -> str:
    """What made an image, such as ``bent rays, Gauss-Newton`` or ``full waveform to 450 kHz``."""
    settings = result.settings
    if settings.method == "waveform":
        bands = [one.band_hz[1] for one in result.history if one.band_hz and not one.of_attenuation]
        return f"full waveform to {1e-3 * max(bands):.0f} kHz" if bands else "full waveform"
    width = settings.numerics.ray_width_m
    return label({"rays": settings.rays, "method": settings.method, "ray_width_m": width})


def label(changes: dict[str, Any]) -> str:
    """Label such as ``straight rays, SART`` or ``bent finite-frequency rays, Gauss-Newton``."""
    rays = "straight" if changes["rays"] == "straight" else "bent"
    wide = " finite-frequency" if changes.get("ray_width_m") else ""
    words = [f"{rays}{wide} rays"]
    if "method" in changes:
        words.append({"sart": "SART", "gauss-newton": "Gauss-Newton"}[changes["method"]])
    if changes.get("edge_mps"):
        words.append("sharp edges")
    if "penalty_strength" in changes and not wide:
        words.append(f"penalty {changes['penalty_strength']:g}")
    return ", ".join(words)

"""Which rays and method explain a scan best: each is shown part of the pairs and must predict the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ...acquisition import Dataset
from ...errors import InvalidInput
from .. import pairs
from ..grid_schedule import stages
from ..result import Reconstruction, Trial
from ..settings import Settings
from ..stopping import noise_of, stopped
from ..task_chains import Drive, Scan
from .candidates import TrialChain
from .finite_frequency_candidates import STRAIGHT, choose_wide, mean_of, size_of, wide
from .held_out import Part

PAIRS: tuple[Part, Part] = ("shown", "held-out")
VIEWS: tuple[Part, Part] = ("shown-views", "held-out-views")

# What is tried with thin rays: bent ones lose where the picked times are not those of the Eikonal equation.
CANDIDATES: tuple[dict[str, Any], ...] = (
    {"rays": "straight", "method": "sart"},
    {"rays": "straight", "method": "gauss-newton"},
    {"rays": "curved", "method": "sart"},
    {"rays": "curved", "method": "sart", "front_smoothing_nodes": 4.0},
    {"rays": "curved", "method": "gauss-newton"},
    {"rays": "curved", "method": "gauss-newton", "edge_mps": 7.0},
)

# The same for waves of a known frequency that rays as wide do not explain: straight ones by SART alone, which
# fits less closely. Gauss–Newton predicts scattered pairs better, and its image is worse (33 against 27 m/s).
BANDED: tuple[dict[str, Any], ...] = tuple(
    changes for changes in CANDIDATES if changes != {"rays": "straight", "method": "gauss-newton"}
)

# Trials use half the nodes, but not fewer than this.
TRIAL_NODES = 64

# Bent rays must predict held-out pairs this much better than straight ones, which ask for less belief. On a
# wave simulation whose bent image was 2 m/s worse than the straight one the ratio was 0.95; on Eikonal times
# from 0.9 (water faster than a fat ring) down to 0.35.
CLEARLY = 0.92


def tried(settings: Settings, candidates: Sequence[dict[str, Any]] = CANDIDATES) -> list[Settings]:
    """The settings of each trial: those of the candidates on a coarser grid."""
    nodes = min(settings.nodes, max(TRIAL_NODES, -(-settings.nodes // 2)))
    coarser = nodes / settings.nodes
    found = []
    for changes in candidates:
        plan = replace(settings, **changes, attenuation=False, resolution_check=False)
        front = plan.front_smoothing_nodes * coarser
        # An image of half the nodes has half the edge nodes for the same rays.
        strength = plan.penalty_strength * (coarser if plan.ray_width_m > 0.0 else 1.0)
        found.append(
            replace(
                plan, nodes=nodes, coarser_grids=0, front_smoothing_nodes=front, penalty_strength=strength
            )
        )
    return found


def advise(
    dataset: Dataset,
    settings: Settings,
    index: int,
    scan_of: Callable[[Settings, Part], Scan],
    drive: Drive,
    after: int = 0,
) -> tuple[Settings, tuple[Trial, ...], int]:
    """The settings that explain one slice best, and how all that were tried did.

    Where the frequency is known rays as wide as waves are tried first, straight and bent, on held-out views,
    see ``choose_wide``. Where it is not, or such rays do not explain the times, what predicts held-out pairs
    best is chosen among thin rays, see ``choose``. The reconstruction is told to stop at the noise of the
    times (Morozov's discrepancy principle), for a closer fit would draw it, unless the trial shows that there
    is less of it.

    Args:
        dataset: for its frequency and the noise of its times.
        settings: that leave rays and method to the trials.
        index: the slice to try.
        scan_of: makes a scan of a part of the pairs.
        drive: runs chains to their end.
        after: emitter passes that come after the reconstruction, at most.

    Returns:
        The settings; the trials, the chosen one first and the others by what they predict; and the emitter
        passes that they took.

    Raises:
        InvalidInput: for a slice without pairs, or with too few to hold some out.
    """
    told = wide(dataset, settings)
    thin = BANDED if told else CANDIDATES
    rest = passes_to_come(dataset, settings) + after
    trials: list[Trial] = []
    chosen, before = None, 0
    if told and not _lacking(VIEWS, settings, index, scan_of):
        chains = _chains(settings, told, index, VIEWS, scan_of)
        others_after = sum(chain.total for chain in _chains(settings, thin, index, PAIRS, scan_of))
        drive(chains, 0, others_after + rest)
        trials, before = _results(told, chains), sum(chain.total for chain in chains)
        chosen = choose_wide(trials, size_of(dataset))
    if chosen is None:
        _check_parts(settings, index, scan_of)
        chains = _chains(settings, thin, index, PAIRS, scan_of)
        drive(chains, before, rest)
        trials, before = _results(thin, chains), before + sum(chain.total for chain in chains)
        chosen = choose(trials)
    others = sorted((t for t in trials if t is not chosen), key=lambda trial: trial.held_out_rms_s)
    found = replace(settings, **chosen.settings)
    return stopped(found, chosen, noise_of(dataset)), (chosen, *others), before


def _chains(
    settings: Settings,
    candidates: Sequence[dict[str, Any]],
    index: int,
    parts: tuple[Part, Part],
    scan_of: Callable[[Settings, Part], Scan],
) -> list[TrialChain]:
    shown, held_out = parts
    plans = tried(settings, candidates)
    return [TrialChain(scan_of(plan, shown), index, scan_of(plan, held_out)) for plan in plans]


def _results(candidates: Sequence[dict[str, Any]], chains: Sequence[TrialChain]) -> list[Trial]:
    return [
        Trial(changes, chain.held_out_rms_s, chain.history[-1].residual_rms_s, chain.held_out_mean_s)
        for changes, chain in zip(candidates, chains, strict=True)
    ]


def passes_to_come(dataset: Dataset, settings: Settings) -> int:
    """Emitter passes that a reconstruction takes at most, whichever candidate is chosen."""
    every = (*CANDIDATES, *wide(dataset, settings))
    plans = [stages(dataset, replace(settings, **changes)) for changes in every]
    each = max(sum(plan.sweeps for plan in found) for found in plans)
    each += settings.attenuation and dataset.log_ratio_np is not None
    each += settings.resolution_check
    problems = range(pairs.count(dataset, settings))
    return each * sum(len(pairs.of(dataset, settings, index).emitters) for index in problems)


def _check_parts(settings: Settings, index: int, scan_of: Callable[[Settings, Part], Scan]) -> None:
    plan = tried(settings)[0]
    scan_of(plan, "all").problem(index)
    if part := _lacking(PAIRS, settings, index, scan_of):
        accepted = f"sart or gauss-newton, for slice {index} has no pair that is {part}"
        raise InvalidInput("method", repr(settings.method), accepted)


def _lacking(
    parts: Sequence[Part], settings: Settings, index: int, scan_of: Callable[[Settings, Part], Scan]
) -> Part | None:
    """The first part that the slice has no pair of; None: it has pairs of all."""
    for part in parts:
        try:
            scan_of(tried(settings)[0], part).problem(index)
        except InvalidInput:
            return part
    return None


def choose(trials: Sequence[Trial]) -> Trial:
    """The trial that predicts best; one with straight rays unless bent ones are clearly better."""
    best = min(trials, key=lambda trial: trial.held_out_rms_s)
    straight = min(
        (trial for trial in trials if trial.settings["rays"] == "straight"),
        key=lambda trial: trial.held_out_rms_s,
    )
    return best if best.held_out_rms_s < CLEARLY * straight.held_out_rms_s else straight


def reason(trials: Sequence[Trial]) -> str:
    """One sentence: what was chosen and why, and how well each trial predicted; empty without trials."""
    if not trials:
        return ""
    if any("ray_width_m" in trial.settings for trial in trials):
        told = [f"{_named(trial.settings)} {1e9 * mean_of(trial):.0f} ns" for trial in trials]
        why = "mean misfit of held-out views, for rays as wide as waves"
        if mean_of(trials[0]) > min(mean_of(t) for t in trials if "ray_width_m" in t.settings):
            needed = f"{100.0 * (1.0 - STRAIGHT):.0f} % better"
            why += f"; where both explain the times straight ones must be {needed}"
        return f"auto chose {told[0]} ({why}); the others: {', '.join(told[1:])}"
    told = [f"{_named(trial.settings)} {1e9 * trial.held_out_rms_s:.0f} ns" for trial in trials]
    best = min(trial.held_out_rms_s for trial in trials)
    why = "misfit of held-out pairs"
    if trials[0].held_out_rms_s > best:
        why += f"; bent rays must be {100.0 * (1.0 - CLEARLY):.0f} % better"
    return f"auto chose {told[0]} ({why}); the others: {', '.join(told[1:])}"


def told(result: Reconstruction) -> str:
    """What ``reason`` says of a result, and what waves gave or would; empty where nothing was tried."""
    return "; ".join(part for part in (reason(result.trials), result.provenance.get("waveform", "")) if part)


def _named(changes: dict[str, Any]) -> str:
    """As ``straight sart`` or ``curved sart (front_smoothing_nodes 4)``."""
    more = [f"{name} {value:g}" for name, value in changes.items() if name not in ("rays", "method")]
    plain = " ".join(str(changes[name]) for name in ("rays", "method") if name in changes)
    return f"{plain} ({', '.join(more)})" if more else plain

"""Which rays and method explain a scan best: each is shown part of the pairs and must predict the others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..acquisition import Dataset
from ..errors import InvalidInput
from . import pairs
from .chains import Chain, Scan
from .holding_out import Part
from .result import Reconstruction, Trial
from .settings import Settings
from .stages import stages
from .stopping import noise_of, stopped
from .trials import TrialChain

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

# What is tried where the frequency tells how wide a wave is: rays of that width, straight and bent ones by
# the same method, so that nothing but the bends tells them apart; and thin bent ones, in case of times that
# no wave was asked for.
WIDE: tuple[dict[str, Any], ...] = (
    {"rays": "straight", "method": "gauss-newton"},
    {"rays": "curved", "method": "gauss-newton"},
)
THIN: tuple[dict[str, Any], ...] = CANDIDATES[4:]

# Standard deviation of the Gaussian across a wide ray, wavelengths, and its penalty over the settings'. No
# misfit tells the width: the thinner the rays, the more they explain, wrong picks too.
WIDTH_WAVES = 1.0
STIFFER = 2.0

# So thin rays are believed once they miss by less than this part: on times of the Eikonal equation, said to
# be of 400 kHz, it was 0.4 to 0.5, on picks from waves 0.8 to 1.
EXACT = 0.6

# Where rays miss held-out views by less than this part of the times themselves, both kinds explain the scan
# and their difference says little: straight ones fit nearly any smooth times by a wrong image, so they must
# miss by less than the second part of what bent ones do. Rules of thumb, from scans in
# benchmarks/results/tried.md.
EXPLAINED_PART = 0.1
STRAIGHT = 0.8

# Trials use half the nodes, but not fewer than this.
TRIAL_NODES = 64

# Bent rays must predict held-out pairs this much better than straight ones, which ask for less belief. On a
# wave simulation whose bent image was 2 m/s worse than the straight one the ratio was 0.95; on Eikonal times
# from 0.9 (water faster than a fat ring) down to 0.35.
CLEARLY = 0.92


def wide(dataset: Dataset, settings: Settings) -> list[dict[str, Any]]:
    """Candidates where the scan's frequency is known; none elsewhere, and none in space."""
    if dataset.center_frequency_hz is None or settings.decomposition == "volume":
        return []
    more = {
        "ray_width_m": WIDTH_WAVES * dataset.water_speed_mps / dataset.center_frequency_hz,
        "penalty_strength": STIFFER * settings.penalty_strength,
    }
    return [*({**changes, **more} for changes in WIDE), *THIN]


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
    drive: Callable[[Sequence[Chain], int, int], None],
    after: int = 0,
) -> tuple[Settings, tuple[Trial, ...], int]:
    """The settings that explain one slice best, and how all that were tried did.

    What predicts held-out pairs best is chosen, see ``choose``; where the frequency is known, of rays that
    are as wide as waves, the straight or the bent ones, whichever predict held-out views better, see
    ``choose_wide``. The reconstruction is told to stop at the noise of the times (Morozov's discrepancy
    principle), for a closer fit would draw it, unless the trial shows that there is less of it.

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
    candidates = wide(dataset, settings)
    parts = VIEWS
    if not candidates or _lacking(VIEWS, settings, index, scan_of):
        candidates, parts = list(CANDIDATES), PAIRS
        _check_parts(settings, index, scan_of)
    plans = tried(settings, candidates)
    chains = [TrialChain(scan_of(plan, parts[0]), index, scan_of(plan, parts[1])) for plan in plans]
    drive(chains, 0, passes_to_come(dataset, settings) + after)
    trials = [
        Trial(changes, chain.held_out_rms_s, chain.history[-1].residual_rms_s, chain.held_out_mean_s)
        for changes, chain in zip(candidates, chains, strict=True)
    ]
    chosen = choose(trials) if parts == PAIRS else choose_wide(trials, _size(dataset))
    others = sorted((t for t in trials if t is not chosen), key=lambda trial: trial.held_out_rms_s)
    found = replace(settings, **chosen.settings)
    passes = sum(chain.total for chain in chains)
    return stopped(found, chosen, noise_of(dataset)), (chosen, *others), passes


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


def choose_wide(trials: Sequence[Trial], size_s: float) -> Trial:
    """Of the trials with wide rays the one that predicts better; thin rays if they do far better still.

    By the mean size of what they miss, for picks of first arrivals that were too weak are wrong by periods.
    Where both explain the times, straight rays must be clearly better than bent ones.

    Args:
        trials: of the candidates of ``wide``.
        size_s: mean size of the times, s.
    """
    wide_rays = {t.settings["rays"]: t for t in trials if "ray_width_m" in t.settings}
    straight, bent = wide_rays["straight"], wide_rays["curved"]
    part = STRAIGHT if _mean(bent) < EXPLAINED_PART * size_s else 1.0
    best = straight if _mean(straight) < part * _mean(bent) else bent
    thin = min((t for t in trials if "ray_width_m" not in t.settings), key=_mean)
    return thin if _mean(thin) < EXACT * _mean(best) else best


def _size(dataset: Dataset) -> float:
    """Mean size of the times, s."""
    return float(np.nanmean(np.abs(dataset.differential_tof())))


def _mean(trial: Trial) -> float:
    return math.inf if trial.held_out_mean_s is None else trial.held_out_mean_s


def reason(trials: Sequence[Trial]) -> str:
    """One sentence: what was chosen and why, and how well each trial predicted; empty without trials."""
    if not trials:
        return ""
    if any("ray_width_m" in trial.settings for trial in trials):
        told = [f"{_named(trial.settings)} {1e9 * _mean(trial):.0f} ns" for trial in trials]
        why = "mean misfit of held-out views, for rays as wide as waves"
        if _mean(trials[0]) > min(_mean(t) for t in trials if "ray_width_m" in t.settings):
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

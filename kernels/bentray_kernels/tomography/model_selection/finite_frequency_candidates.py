"""Trials with rays as wide as waves: what is tried where the frequency is known, and what is believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...acquisition import Dataset
from ..result import Trial
from ..settings import Settings

# What is tried where the frequency tells how wide a wave is: rays of that width, straight and bent ones by
# the same method, so that nothing but the bends tells them apart; and thin bent ones, which tell times that
# wide ones cannot explain.
WIDE: tuple[dict[str, Any], ...] = (
    {"rays": "straight", "method": "gauss-newton"},
    {"rays": "curved", "method": "gauss-newton"},
)
THIN = WIDE[1]

# Standard deviation of the Gaussian across a wide ray, wavelengths, and its penalty over the settings'. No
# misfit tells the width: the thinner the rays, the more they explain, wrong picks too.
WIDTH_WAVES = 1.0
STIFFER = 2.0

# So wide rays are given up once thin ones miss by less than this part: on times of the Eikonal equation, said
# to be of 400 kHz, it was 0.4 to 0.5, on a scan of ten wavelengths 0.5, on other picks from waves 0.8 to 1.3.
EXACT = 0.6

# Where rays miss held-out views by less than this part of the times themselves, both kinds explain the scan
# and their difference says little: straight ones fit nearly any smooth times by a wrong image, so they must
# miss by less than the second part of what bent ones do. Rules of thumb, from scans in
# benchmarks/results/raw_trace_experiments.md.
EXPLAINED_PART = 0.1
STRAIGHT = 0.8


def wide(dataset: Dataset, settings: Settings) -> list[dict[str, Any]]:
    """Candidates where the scan's frequency is known; none elsewhere, and none in space."""
    if dataset.center_frequency_hz is None or settings.decomposition == "volume":
        return []
    more = {
        "ray_width_m": WIDTH_WAVES * dataset.water_speed_mps / dataset.center_frequency_hz,
        "penalty_strength": STIFFER * settings.penalty_strength,
    }
    return [*({**changes, **more} for changes in WIDE), THIN]


def choose_wide(trials: Sequence[Trial], size_s: float) -> Trial | None:
    """Of the trials with wide rays the one that predicts better; None if thin rays do far better still.

    By the mean size of what they miss, for picks of first arrivals that were too weak are wrong by periods.
    Where both explain the times, straight rays must be clearly better than bent ones.

    Args:
        trials: of the candidates of ``wide``.
        size_s: mean size of the times, s.
    """
    wide_rays = {t.settings["rays"]: t for t in trials if "ray_width_m" in t.settings}
    straight, bent = wide_rays["straight"], wide_rays["curved"]
    part = STRAIGHT if mean_of(bent) < EXPLAINED_PART * size_s else 1.0
    best = straight if mean_of(straight) < part * mean_of(bent) else bent
    thin = min((t for t in trials if "ray_width_m" not in t.settings), key=mean_of)
    return None if mean_of(thin) < EXACT * mean_of(best) else best


def size_of(dataset: Dataset) -> float:
    """Mean size of the times, s."""
    return float(np.nanmean(np.abs(dataset.differential_tof())))


def mean_of(trial: Trial) -> float:
    """Mean size of the misfit of what was held out, s; infinite where it is not known."""
    return math.inf if trial.held_out_mean_s is None else trial.held_out_mean_s

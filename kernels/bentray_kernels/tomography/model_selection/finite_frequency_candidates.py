"""Candidates with finite-frequency (fat) rays for scans of known frequency, and the choice among them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...acquisition import Dataset
from ..result import Candidate
from ..settings import Settings

# Finite-frequency rays, straight and bent by the same method, so that they differ in refraction alone; and
# thin bent rays, which show times that finite-frequency rays cannot explain.
WIDE: tuple[dict[str, Any], ...] = (
    {"rays": "straight", "method": "gauss-newton"},
    {"rays": "curved", "method": "gauss-newton"},
)
THIN = WIDE[1]

# Standard deviation of the Gaussian across a fat ray: this part of √(wavelength · width of the array), the
# scale of the Fresnel zone of the longest rays, but at most one wavelength; and its penalty relative to the
# settings. The misfit cannot select the width: thinner rays fit everything better, wrong picks included. One
# wavelength was chosen on arrays of 39 and 50 wavelengths; it is too wide on those of 10 to 25.
FRESNEL_PART = 0.16
STIFFER = 2.0

# Fat rays are rejected where the misfit of thin ones is below this part of theirs: it was 0.4 to 0.5 on times
# of the Eikonal equation labelled 400 kHz, 0.7 to 1.3 on picks from wave simulations.
EXACT = 0.6

# Where the misfit of held-out views is below this part of the times themselves, both kinds explain the scan:
# straight rays fit nearly any smooth times with a wrong image, so their misfit must be below the second part
# of that of bent rays. Rules of thumb, from scans in benchmarks/results/raw_trace_experiments.md.
EXPLAINED_PART = 0.1
STRAIGHT = 0.8


def finite_frequency_candidates(dataset: Dataset, settings: Settings) -> list[dict[str, Any]]:
    """Candidates of a scan with a known frequency; none without it, and none for volumes."""
    if dataset.center_frequency_hz is None or settings.decomposition == "volume":
        return []
    wavelength = dataset.water_speed_mps / dataset.center_frequency_hz
    # The larger extent of the array along x or y: the diameter of a ring.
    width = float(np.ptp(dataset.element_position_m[:, :2], axis=0).max())
    more = {
        "ray_width_m": min(wavelength, FRESNEL_PART * math.sqrt(wavelength * width)),
        "penalty_strength": STIFFER * settings.gauss_newton.penalty_strength,
    }
    return [*({**changes, **more} for changes in WIDE), THIN]


def choose_finite_frequency(candidates: Sequence[Candidate], mean_time_s: float) -> Candidate | None:
    """The better candidate with finite-frequency rays; None without any, or if thin rays are far better.

    By the mean absolute misfit, because picks of weak first arrivals are wrong by whole periods. Where both
    explain the times, straight rays must be clearly better than bent ones.

    Args:
        candidates: of ``finite_frequency_candidates``, of all or only of straight rays.
        mean_time_s: mean absolute travel time difference, s.
    """
    fat = {t.settings["rays"]: t for t in candidates if "ray_width_m" in t.settings}
    if len(fat) < len(WIDE):
        return next(iter(fat.values()), None)
    straight, bent = fat["straight"], fat["curved"]
    factor = STRAIGHT if mean_misfit(bent) < EXPLAINED_PART * mean_time_s else 1.0
    best = straight if mean_misfit(straight) < factor * mean_misfit(bent) else bent
    thin = min((t for t in candidates if "ray_width_m" not in t.settings), key=mean_misfit)
    return None if mean_misfit(thin) < EXACT * mean_misfit(best) else best


def mean_time(dataset: Dataset) -> float:
    """Mean absolute travel time difference of object and water, s."""
    return float(np.nanmean(np.abs(dataset.differential_tof())))


def mean_misfit(candidate: Candidate) -> float:
    """Mean absolute misfit of the held-out pairs, s; infinite where it is not known."""
    return math.inf if candidate.held_out_mean_s is None else candidate.held_out_mean_s

"""The noise of travel times, and the misfit at which a reconstruction has explained them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..acquisition import Dataset
from ..acquisition.noise import noise_level, root_mean_square
from ..arrays import Floats
from .settings import Settings

# A misfit of this many times the noise explains the times (the factor of Morozov's principle).
EXPLAINED = 1.1


def stop_at_noise(settings: Settings, misfit_s: float, noise_s: float) -> Settings:
    """The settings with the misfit to stop at, unless a held-out one, s, shows that there is less noise."""
    if settings.numerics.stop_rms_s is None and noise_s <= EXPLAINED * misfit_s:
        return settings.changed(stop_rms_s=EXPLAINED * noise_s)
    return settings


def travel_time_noise(dataset: Dataset, deviation: Callable[[Floats], float] = root_mean_square) -> float:
    """Standard deviation of the travel times, s: from the dataset, or estimated from their roughness.

    Args:
        dataset: with travel times.
        deviation: see ``noise_level``.
    """
    if dataset.sigma_s is not None:
        known = dataset.sigma_s[np.isfinite(dataset.differential_tof()) & np.isfinite(dataset.sigma_s)]
        if known.size:
            return math.sqrt(float((known**2).mean()))
    return noise_level(dataset.differential_tof(), deviation)

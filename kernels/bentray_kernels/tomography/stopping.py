"""The noise of travel times, and the misfit at which a reconstruction has explained them."""

from __future__ import annotations

import math

import numpy as np

from ..acquisition import Dataset
from ..acquisition.noise import noise_level
from .result import Trial
from .settings import Settings

# A misfit of this many times the noise explains the times (the factor of Morozov's principle).
EXPLAINED = 1.1


def stopped(settings: Settings, chosen: Trial, noise_s: float) -> Settings:
    """The settings with the misfit to stop at, unless the chosen trial shows that there is less noise."""
    if settings.numerics.stop_rms_s is None and noise_s <= EXPLAINED * chosen.held_out_rms_s:
        return settings.changed(stop_rms_s=EXPLAINED * noise_s)
    return settings


def noise_of(dataset: Dataset) -> float:
    """Standard deviation of the travel times, s: as the dataset tells it, or as their roughness does."""
    if dataset.sigma_s is not None:
        told = dataset.sigma_s[np.isfinite(dataset.differential_tof()) & np.isfinite(dataset.sigma_s)]
        if told.size:
            return math.sqrt(float((told**2).mean()))
    return noise_level(dataset.differential_tof())

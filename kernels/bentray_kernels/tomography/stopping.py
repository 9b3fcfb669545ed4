"""The noise of travel times, and the misfit at which a reconstruction has explained them."""

import math
from collections.abc import Callable

import numpy as np

from ..acquisition import Dataset
from ..acquisition.noise import noise_level, root_mean_square
from ..arrays import Floats
from .pairs import reciprocal_differences
from .settings import Settings

# A misfit of this many times the noise explains the times (the factor of Morozov's principle).
EXPLAINED = 1.1


def stop_at_noise(settings: Settings, misfit_s: float, dataset: Dataset) -> Settings:
    """The settings with the misfit to stop at, unless a held-out one shows that there is less noise.

    Args:
        settings: of the reconstruction.
        misfit_s: root mean square of held-out pairs, each the mean of its times, s.
        dataset: with travel times.
    """
    noise = travel_time_noise(dataset)
    of_pairs = noise * _of_means(dataset)
    if settings.numerics.stop_rms_s is None and of_pairs <= EXPLAINED * misfit_s:
        # SART fits each time, Gauss-Newton the mean of the two times of a pair.
        return settings.changed(stop_rms_s=EXPLAINED * (noise if settings.method == "sart" else of_pairs))
    return settings


def _of_means(dataset: Dataset) -> float:
    """The noise of the mean times of pairs over that of single times; 1 where the noise is only estimated.

    An estimate contains part of the object, which both directions share.
    """
    if dataset.sigma_s is None:
        return 1.0
    delta = dataset.differential_tof().reshape(-1, len(dataset.tx), len(dataset.rx))
    times = int(np.isfinite(delta).sum())
    both = sum(reciprocal_differences(dataset.tx, dataset.rx, times).size for times in delta)
    # Of times − both pairs, ``both`` have half the variance.
    return math.sqrt(1.0 - 0.5 * both / (times - both)) if both else 1.0


def travel_time_noise(dataset: Dataset, deviation: Callable[[Floats], float] = root_mean_square) -> float:
    """Standard deviation of the travel times, s: from the dataset, or estimated from their roughness.

    Args:
        dataset: with travel times.
        deviation: see ``noise_level``.
    """
    if dataset.sigma_s is not None:
        sigma = dataset.sigma_s[np.isfinite(dataset.differential_tof()) & np.isfinite(dataset.sigma_s)]
        if sigma.size:
            return math.sqrt(float((sigma**2).mean()))
    return noise_level(dataset.differential_tof(), deviation)

"""Guided picking: travel times that an image predicts, near which arrivals are picked again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..acquisition import Dataset
from ..arrays import Floats
from ..errors import InvalidInput
from .gauss_newton.gauss_newton_step import trace_rays
from .problem import Problem
from .result import Reconstruction

# Picks that move less than this between rounds, s, would give the same image again.
SETTLED_S = 1e-9


def predicted_delta(dataset: Dataset, result: Reconstruction) -> Floats:
    """Predicted travel time difference (object minus water) of every pair, (…, ntx, nrx), s.

    Along the rays of the image's own method, bent to the stationary path where they are curved.

    Args:
        dataset: with the elements and slices of the image.
        result: reconstructed slice by slice.

    Raises:
        InvalidInput: for a volume, or an array in space.
    """
    settings = result.settings
    if settings.decomposition != "slices":
        raise InvalidInput("decomposition", repr(settings.decomposition), "slices, to pick with a prediction")
    if dataset.element_position_m.shape[1] != 2:
        raise InvalidInput(
            "geometry/element_position_m",
            "elements in space",
            "elements in a plane, to pick with a prediction",
        )
    shape = (len(dataset.tx), len(dataset.rx))
    same_element = dataset.tx[:, None] == dataset.rx[None, :]
    whole = shape if dataset.slice_z_m is None else (dataset.slices, *shape)
    # With a measured difference of 0 for every pair, the residual is minus the prediction.
    zeroed = replace(
        dataset, delta_tof_s=np.zeros(whole), tof_s=None, sigma_s=None, valid=None, log_ratio_np=None
    )
    predicted = np.full((dataset.slices, *shape), np.nan)
    for index in range(dataset.slices):
        problem = Problem.from_dataset(
            zeroed, settings.changed(reciprocity=False, opening_angle_deg=None), index
        )
        speed = result.speed if result.speed.ndim == 2 else result.speed[:, :, index]
        rows = trace_rays(problem, settings, 1.0 / speed, np.arange(len(dataset.tx)))
        predicted[index][~same_element] = -rows.residual
    return predicted[0] if dataset.slice_z_m is None else predicted


def same_picks(before: Dataset, after: Dataset) -> bool:
    """Whether the picks are those of the previous round."""
    old, new = before.differential_tof(), after.differential_tof()
    valid = np.isfinite(old)
    if (valid != np.isfinite(new)).any():
        return False
    change = (new - old)[valid]
    return not change.size or float(np.sqrt(np.mean(change**2))) < SETTLED_S

"""Delays and displacements of single elements, fitted to residuals of travel times in water."""

from typing import NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ..dataset import Dataset
from ..noise import robust_deviation

# Iterations over all elements, and of the selection of residuals of one element.
ROUNDS, SELECTIONS = 3, 4

# Residuals beyond this many robust deviations are excluded.
OUTLYING = 4.0

# Fewest residuals of an element: two coordinates, two delays, and redundant ones.
MIN_PAIRS = 12

# Combinations of coordinates and delays that residuals determine worse than this part of the best remain 0.
UNDETERMINED = 0.02


class ElementErrors(NamedTuple):
    """Errors of elements; NaN where too few residuals determine them.

    Attributes:
        emission_delay_s, reception_delay_s: (elements,), s.
        displacement_m: (elements, 2), true minus stated position, m.
        sigma_s: (elements, 4), standard deviations of displacement over the speed of the water, emission and
            reception, s.
    """

    emission_delay_s: Floats
    reception_delay_s: Floats
    displacement_m: Floats
    sigma_s: Floats


def fit_element_errors(dataset: Dataset, residual_s: Floats) -> ElementErrors:
    """Fit each element in turn, with the errors of the others removed, by least squares without outliers.

    Args:
        dataset: of one slice.
        residual_s: (ntx, nrx), s: times in water minus those of the stated positions; NaN where unknown.
    """
    position, elements = dataset.element_position_m[:, :2], len(dataset.element_position_m)
    away = position[dataset.tx][:, None] - position[dataset.rx][None]
    # Direction of growing times for the emitter; that of the receiver is the opposite.
    away /= np.maximum(np.linalg.norm(away, axis=-1), 1e-12)[..., None]
    middle = float(np.nanmedian(residual_s)) if np.isfinite(residual_s).any() else 0.0
    left = residual_s - middle
    # Displacement over the speed of the water, and delays in emission and reception, s.
    errors, sigma = np.zeros((elements, 4)), np.full((elements, 4), np.inf)
    few = np.zeros(elements, dtype=bool)
    for _ in range(ROUNDS):
        for k in range(elements):
            emission, reception = np.flatnonzero(dataset.tx == k), np.flatnonzero(dataset.rx == k)
            rows = _design(away, emission, reception)
            values = np.concatenate((left[emission].ravel(), left[:, reception].ravel()))
            values = np.asarray(values + rows @ errors[k], dtype=np.float64)
            few[k] = np.isfinite(values).sum() < MIN_PAIRS
            if few[k]:
                continue
            errors[k], sigma[k] = _robust_fit(rows[np.isfinite(values)], values[np.isfinite(values)])
            values = values - rows @ errors[k]
            split = left[emission].size
            left[emission] = values[:split].reshape(left[emission].shape)
            left[:, reception] = values[split:].reshape(left[:, reception].shape)
    errors[few] = np.nan
    displacement = errors[:, :2] * dataset.water_speed_mps
    return ElementErrors(errors[:, 2], errors[:, 3], displacement, sigma)


def _design(away: Floats, emission: Ints, reception: Ints) -> Floats:
    """Derivatives of the times of an element by its displacement and its delays, (pairs, 4)."""
    sent, received = away[emission].reshape(-1, 2), -away[:, reception].reshape(-1, 2)
    rows = np.zeros((len(sent) + len(received), 4))
    rows[:, :2] = np.concatenate((sent, received))
    rows[: len(sent), 2] = rows[len(sent) :, 3] = 1.0
    return rows


def _robust_fit(rows: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Least squares, repeated without the values far from the previous fit, and its standard deviations."""
    # The first selection is about the median, because many values of a late element are far from zero.
    off = np.asarray(values - np.median(values), dtype=np.float64)
    solution, sigma = np.zeros(rows.shape[1]), np.full(rows.shape[1], np.inf)
    for _ in range(SELECTIONS):
        scatter = robust_deviation(off)
        near = np.abs(off - np.median(off)) <= OUTLYING * scatter + 1e-12
        if near.sum() < MIN_PAIRS:
            break
        inverse = np.linalg.pinv(rows[near].T @ rows[near], rcond=UNDETERMINED**2, hermitian=True)
        solution = np.asarray(inverse @ (rows[near].T @ values[near]))
        sigma = np.asarray(scatter * np.sqrt(np.maximum(np.diag(inverse), 0.0)))
        off = np.asarray(values - rows @ solution, dtype=np.float64)
    return solution, sigma

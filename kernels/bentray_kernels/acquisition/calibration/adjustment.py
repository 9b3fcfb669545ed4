"""Least-squares adjustment of the water shot: positions, delays and speed, damped and reweighted."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from ...arrays import Flags, Floats, Ints
from ...errors import InvalidInput
from ..dataset import Dataset
from ..noise import robust_deviation
from .result import Calibration

# Iterations end when the largest move of an element is below this, m.
SETTLED_M = 1e-8
MAX_ITERATIONS = 30

# No element moves further than this in one iteration, m.
LONGEST_STEP_M = 2e-3

# Residuals beyond this many robust deviations are excluded.
OUTLYING = 4.0

# Fewest pairs of an adjusted element: two coordinates, two delays, and one redundant pair.
MIN_PER_ELEMENT = 6


class _Unknowns(NamedTuple):
    """Where the unknowns are in the vector; the slowness of the water is the last one."""

    position: slice
    emission: slice
    reception: slice
    common: int
    size: int

    @classmethod
    def from_dataset(cls, dataset: Dataset) -> _Unknowns:
        emission = 2 * len(dataset.element_position_m)
        reception = emission + len(dataset.tx)
        common = reception + len(dataset.rx)
        return cls(slice(emission), slice(emission, reception), slice(reception, common), common, common + 2)


def calibrate(
    dataset: Dataset, times_s: Floats, *, sigma_s: float | None = None, fit_speed: bool = False
) -> Calibration:
    """Fit positions, delays and speed to the times of the water shot.

    t_er = common + emission_e + reception_r + |p_e - p_r| / c, by Gauss–Newton. A water shot does not
    determine position and orientation of the array, the distribution of the mean delay, nor size and speed at
    the same time. These are kept: centroid, orientation, delays of mean 0; and the speed, or with
    ``fit_speed`` the size.

    Args:
        dataset: with nominal element positions and the water speed, for example from its temperature.
        times_s: (ntx, nrx), s, see ``water_times``; NaN where there is none.
        sigma_s: standard deviation of a time, s; None: from the residuals.
        fit_speed: fit the water's speed; for arrays whose size is better known than the temperature.

    Raises:
        InvalidInput: for 3-D elements, too few times, or times that do not determine the unknowns.
    """
    if dataset.element_position_m.shape[1] != 2:
        raise InvalidInput(
            "geometry/element_position_m", "elements in space", "elements in a plane, to be calibrated"
        )
    if times_s.shape != (len(dataset.tx), len(dataset.rx)):
        accepted = f"({len(dataset.tx)}, {len(dataset.rx)})"
        raise InvalidInput("times_s", f"shape {times_s.shape}", accepted)
    at = _Unknowns.from_dataset(dataset)
    emitter, receiver = np.nonzero(np.isfinite(times_s) & (dataset.tx[:, None] != dataset.rx[None, :]))
    time = times_s[emitter, receiver]
    used = _used(dataset, emitter, receiver)
    value = np.zeros(at.size)
    value[at.position] = dataset.element_position_m.ravel()
    value[-1] = 1.0 / dataset.water_speed_mps
    for _ in range(MAX_ITERATIONS):
        rows, residual = _linear(dataset, at, value, emitter, receiver, time)
        # The median is the first estimate of the common delay.
        off = np.abs(residual - np.median(residual[used]))
        inliers = used & (off <= OUTLYING * robust_deviation(residual[used]) + 1e-12)
        free = _free(dataset, at, emitter[inliers], receiver[inliers], fit_speed)
        step, covariance = _step(dataset, at, rows[inliers], residual[inliers], free, fit_speed)
        moved = np.abs(step[at.position]).max()
        value[free] += step[free] * min(1.0, LONGEST_STEP_M / max(moved, 1e-30))
        if moved < SETTLED_M:
            break
    _, residual = _linear(dataset, at, value, emitter, receiver, time)
    residual = residual[inliers]
    spare = residual.size - int(free.sum()) + _gauges(fit_speed)
    noise = sigma_s if sigma_s is not None else math.sqrt(float((residual**2).sum()) / max(spare, 1))
    deviation = np.full(at.size, np.nan)
    deviation[free] = noise * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return _calibration(at, value, deviation, residual, int(used.sum()) - residual.size, fit_speed)


def _gauges(fit_speed: bool) -> int:
    """Number of unknowns fixed by convention."""
    return 6 if fit_speed else 5


def _used(dataset: Dataset, emitter: Ints, receiver: Ints) -> Flags:
    """Pairs whose elements are in enough pairs.

    Raises:
        InvalidInput: for too few pairs.
    """
    used = np.ones(len(emitter), dtype=bool)
    for _ in range(len(dataset.element_position_m)):
        emitted = np.bincount(emitter[used], minlength=len(dataset.tx))
        received = np.bincount(receiver[used], minlength=len(dataset.rx))
        enough = used & (emitted[emitter] >= MIN_PER_ELEMENT) & (received[receiver] >= MIN_PER_ELEMENT)
        if (enough == used).all():
            break
        used = enough
    if used.sum() < 4 * MIN_PER_ELEMENT:
        raise InvalidInput(
            "times_s", f"{int(used.sum())} usable times", f"at least {4 * MIN_PER_ELEMENT} of a water shot"
        )
    return used


def _linear(
    dataset: Dataset, at: _Unknowns, value: Floats, emitter: Ints, receiver: Ints, time: Floats
) -> tuple[sparse.csr_array, Floats]:
    """Derivatives of the times, and residuals."""
    position, slowness = value[at.position].reshape(-1, 2), value[-1]
    a, b = dataset.tx[emitter], dataset.rx[receiver]
    along = position[a] - position[b]
    distance = np.linalg.norm(along, axis=1)
    toward = slowness * along / np.maximum(distance, 1e-12)[:, None]
    ones_column = np.ones(len(time))
    entries = (
        (2 * a, toward[:, 0]),
        (2 * a + 1, toward[:, 1]),
        (2 * b, -toward[:, 0]),
        (2 * b + 1, -toward[:, 1]),
        (at.emission.start + emitter, ones_column),
        (at.reception.start + receiver, ones_column),
        (np.full(len(time), at.common), ones_column),
        (np.full(len(time), at.size - 1), distance),
    )
    row = np.tile(np.arange(len(time)), len(entries))
    columns, values = (np.concatenate(arrays) for arrays in zip(*entries, strict=True))
    rows = sparse.csr_array((values, (row, columns)), shape=(len(time), at.size))
    delay = value[at.emission][emitter] + value[at.reception][receiver] + value[at.common]
    return rows, np.asarray(time - delay - slowness * distance)


def _free(dataset: Dataset, at: _Unknowns, emitter: Ints, receiver: Ints, fit_speed: bool) -> Flags:
    """Unknowns with at least one pair."""
    free = np.zeros(at.size, dtype=bool)
    elements = np.union1d(dataset.tx[emitter], dataset.rx[receiver])
    free[2 * elements] = free[2 * elements + 1] = True
    free[at.emission.start + np.unique(emitter)] = True
    free[at.reception.start + np.unique(receiver)] = True
    free[at.common] = True
    free[-1] = fit_speed
    return free


def _step(
    dataset: Dataset,
    at: _Unknowns,
    rows: sparse.csr_array,
    residual: Floats,
    free: Flags,
    fit_speed: bool,
) -> tuple[Floats, Floats]:
    """Change of all unknowns, and the covariance of the free ones for times of deviation 1.

    Raises:
        InvalidInput: where the times do not determine the unknowns.
    """
    fixed = _conventions(dataset, at, fit_speed)[:, free]
    free_columns = rows[:, np.flatnonzero(free)]
    normal = (free_columns.T @ free_columns).toarray()
    # Unknowns are in m, s and s/m: scaled to similar size.
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-30))
    normal *= scale[:, None] * scale[None, :]
    conventions = fixed * scale[None, :]
    conventions /= np.maximum(np.linalg.norm(conventions, axis=1, keepdims=True), 1e-30)
    # The conventions are met exactly with any weight; a weight similar to the data's keeps the system well
    # posed.
    normal += conventions.T @ conventions * len(scale)
    try:
        factor = cho_factor(normal)
    except np.linalg.LinAlgError:
        raise InvalidInput(
            "times_s", "times that leave positions or delays open", "more pairs, around the whole array"
        ) from None
    change = np.zeros(at.size)
    change[free] = scale * cho_solve(factor, scale * (free_columns.T @ residual))
    inverse = cho_solve(factor, np.eye(len(scale)))
    # The contribution of the conventions is not an uncertainty of the data.
    weight = np.linalg.solve(conventions @ inverse @ conventions.T, conventions @ inverse)
    covariance = inverse - inverse @ conventions.T @ weight
    return change, covariance * scale[:, None] * scale[None, :]


def _conventions(dataset: Dataset, at: _Unknowns, fit_speed: bool) -> Floats:
    """Rows whose product with a change must be 0: translation, rotation, mean delays, and scale."""
    centred = dataset.element_position_m - dataset.element_position_m.mean(axis=0)
    rows = np.zeros((_gauges(fit_speed), at.size))
    rows[0, 0 : at.emission.start : 2] = 1.0
    rows[1, 1 : at.emission.start : 2] = 1.0
    rows[2, 0 : at.emission.start : 2], rows[2, 1 : at.emission.start : 2] = -centred[:, 1], centred[:, 0]
    rows[3, at.emission] = 1.0
    rows[4, at.reception] = 1.0
    if fit_speed:
        rows[5, at.position] = centred.ravel()
    return rows


def _calibration(
    at: _Unknowns, value: Floats, deviation: Floats, residual: Floats, left_out: int, fit_speed: bool
) -> Calibration:
    slowness = float(value[-1])
    return Calibration(
        element_position_m=value[at.position].reshape(-1, 2).copy(),
        position_sigma_m=deviation[at.position].reshape(-1, 2).copy(),
        emission_delay_s=value[at.emission].copy(),
        emission_sigma_s=deviation[at.emission].copy(),
        reception_delay_s=value[at.reception].copy(),
        reception_sigma_s=deviation[at.reception].copy(),
        common_delay_s=float(value[at.common]),
        water_speed_mps=1.0 / slowness,
        water_speed_sigma_mps=float(deviation[-1]) / slowness**2 if fit_speed else 0.0,
        residual_rms_s=math.sqrt(float(np.mean(residual**2))),
        pairs=len(residual),
        left_out=left_out,
    )

"""Consistency of picks with their neighbours and with reciprocity; inconsistent picks are removed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...arrays import Flags
from ..dataset import Dataset, Floats

# Emitters and receivers, itself included, with which a pick is compared: 3 × 5 pairs.
NEAR_EMITTERS = 3
NEAR_RECEIVERS = 5

# A pick may lie this many robust standard deviations of its neighbours from their median.
OUTLYING = 4.0


def consistent(dataset: Dataset, delta: Floats, skip_s: float) -> Floats:
    """The picks with inconsistent ones replaced by NaN.

    Wrong picks are mostly off by a whole period, so smaller deviations than half a period are accepted. A
    pick is removed if it differs by more than that, and by more than ``OUTLYING`` robust standard deviations,
    from the median of the pairs of neighbouring elements. Then both picks of a reciprocal pair that differ by
    more are removed, since it is unknown which one is wrong.

    Args:
        dataset: with the geometry.
        delta: (ntx, nrx), s.
        skip_s: half a period, s.

    Returns:
        (ntx, nrx), s; a new array.
    """
    outlying, _ = outliers(dataset, delta, skip_s)
    remaining = np.where(outlying, np.nan, delta)
    remaining[unreciprocal(dataset, remaining, skip_s)] = np.nan
    return remaining


def outliers(dataset: Dataset, delta: Floats, skip_s: float) -> tuple[Flags, Floats]:
    """Outlying picks, and the departure of each pick from the median of its neighbours.

    Args:
        dataset, delta, skip_s: as ``consistent`` takes them.

    Returns:
        (ntx, nrx) flags, and departures, s; NaN where a pick or its neighbours are missing.
    """
    around = _neighbours(dataset, delta)
    finite = np.isfinite(around)
    count = finite.sum(axis=0)
    # Zeros avoid warnings of medians over columns without neighbours.
    around = np.where(count > 0, around, 0.0)
    middle = np.nanmedian(around, axis=0)
    spread = 1.4826 * np.nanmedian(np.abs(around - middle), axis=0)
    departure = np.where(count >= 3, delta - middle, np.nan)
    with np.errstate(invalid="ignore"):
        far = np.abs(departure) > np.maximum(skip_s, OUTLYING * spread)
    return far, departure


def unreciprocal(dataset: Dataset, delta: Floats, skip_s: float) -> Flags:
    """(ntx, nrx): picks that differ by more than ``skip_s`` from their reciprocal pair."""
    elements = len(dataset.element_position_m)
    full = np.full((elements, elements), np.nan)
    full[np.ix_(dataset.tx, dataset.rx)] = delta
    with np.errstate(invalid="ignore"):
        differ = np.abs(full - full.T) > skip_s
    return np.asarray(differ[np.ix_(dataset.tx, dataset.rx)])


def _neighbours(dataset: Dataset, delta: Floats) -> Floats:
    """(pairs, ntx, nrx) picks of the pairs of neighbouring elements, without the pick itself."""
    emitters = _nearest(dataset.element_position_m[dataset.tx], NEAR_EMITTERS)
    receivers = _nearest(dataset.element_position_m[dataset.rx], NEAR_RECEIVERS)
    return np.stack(
        [
            delta[np.ix_(emitters[:, e], receivers[:, r])]
            for e in range(emitters.shape[1])
            for r in range(receivers.shape[1])
            if e or r
        ]
        or [np.full_like(delta, np.nan)]
    )


def _nearest(position: Floats, count: int) -> NDArray[np.intp]:
    count = min(count, len(position))
    return np.asarray(KDTree(position).query(position, k=count)[1], dtype=np.intp).reshape(
        len(position), count
    )

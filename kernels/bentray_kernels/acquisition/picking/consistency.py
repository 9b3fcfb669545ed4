"""Consistency of picks with their distance, neighbours and reciprocal pair; inconsistent ones are removed."""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...arrays import Flags, Ints
from ..dataset import Dataset, Floats

# Emitters and receivers, itself included, with which a pick is compared: 3 × 5 pairs.
NEAR_EMITTERS = 3
NEAR_RECEIVERS = 5

# A pick may lie this many robust standard deviations of its neighbours from their median.
OUTLYING = 4.0

# Pairs whose neighbours are compared at a time: those of all pairs took 550 bytes a pair.
TOGETHER = 2**12

# As far from the median as the third farthest of 14 neighbours a pick is accepted; one that its reciprocal
# pair confirms, within this part of its departure, up to twice the second farthest.
FAR, CONFIRMED, BEYOND, AGREEING = 3, 2, 2.0, 0.25

# Departures of ``CERTAIN`` standard deviations are usual, from the ``USUAL`` quantile, which is ``NORMAL`` of
# them. ``LEAST`` of the time through the water, 9 m/s along the whole path, always is: cycle jumps of waves
# depart by 90e-3 of it, exact times of simulations from their reverses by up to 5e-3.
CERTAIN, USUAL, NORMAL, LEAST = 6.0, 0.75, 1.15, 6e-3

# The range of apparent speeds is that between these percentiles of pairs that are at least this part of the
# width of the array apart, and as much again on either side, at least this factor.
BULK, APART, AGAIN = (5.0, 95.0), 0.1, 1.25


class Contradictions(NamedTuple):
    """Picks that contradict others, each (ntx, nrx).

    Attributes:
        skip_s: the largest departure that is always accepted, s.
        speeds_mps: range of apparent speeds.
        apparent: outside this range.
        excess_s: how much too late, or too early, for this range; 0 within it.
        outlying: among the neighbours.
        departure_s: from the median of the neighbours; NaN where a pick or its neighbours are missing.
        unreciprocal: both picks of reciprocal pairs that differ.
    """

    skip_s: float
    speeds_mps: tuple[float, float]
    apparent: Flags
    excess_s: Floats
    outlying: Flags
    departure_s: Floats
    unreciprocal: Flags


def consistent(dataset: Dataset, delta: Floats) -> Floats:
    """The picks, (ntx, nrx), s, with inconsistent ones replaced by NaN, see ``contradictions``; a copy."""
    found = contradictions(dataset, delta)
    return np.where(found.apparent | found.outlying | found.unreciprocal, np.nan, delta)


def contradictions(dataset: Dataset, delta: Floats) -> Contradictions:
    """Find picks that contradict their distance, their neighbours or their reciprocal pair.

    Wrong picks are mostly off by a whole period, so smaller deviations than half a period are accepted, and
    the usual ones (see ``usual_departure``), by which picks of an unknown period are judged alone. A pick is
    removed if it is too early or too late for the range of apparent speeds by more than that; then, if it
    differs by more from the median of the pairs of neighbouring elements, and by more than these accept
    (see ``departures``). At last both picks of a reciprocal pair that differ by more are removed, since it is
    unknown which one is wrong.

    Args:
        dataset: with the geometry.
        delta: (ntx, nrx), s.
    """
    departure, accepted = departures(dataset, delta)
    skip = usual_departure(dataset, departure)
    if dataset.center_frequency_hz is not None:
        skip = max(skip, 0.5 / dataset.center_frequency_hz)
    excess, speeds = apparent_excess(dataset, delta)
    with np.errstate(invalid="ignore"):
        apparent = np.abs(excess) > skip
        if apparent.any():
            delta = np.where(apparent, np.nan, delta)
            departure, accepted = departures(dataset, delta)
        outlying = np.abs(departure) > np.maximum(skip, accepted)
    # Outliers are not compared with their reciprocal pair.
    differ = unreciprocal(dataset, np.where(outlying, np.nan, delta), skip)
    return Contradictions(skip, speeds, apparent, excess, outlying, departure, differ)


def apparent_excess(dataset: Dataset, delta: Floats) -> tuple[Floats, tuple[float, float]]:
    """How much too late each arrival is for its distance, and the range of apparent speeds, m/s.

    A first arrival is never later than along the straight path, nor earlier than along a path of the fastest
    speed, so that apparent speeds lie between the lowest and highest speed of object and water.

    Args:
        dataset: of one slice.
        delta: (ntx, nrx), s.

    Returns:
        (ntx, nrx), s: negative where too early, 0 within the range; NaN without a time. Without a distant
        pair the range is infinite.
    """
    distance = dataset.distance_m()
    arrival = np.where(distance > 0.0, delta + distance / dataset.water_speed_mps, np.nan)
    width = float(np.linalg.norm(np.ptp(dataset.element_position_m, axis=0)))
    with np.errstate(invalid="ignore"):
        judged = (arrival > 0.0) & (distance > APART * width)
    if not judged.any():
        return np.zeros_like(delta), (0.0, math.inf)
    low, high = np.percentile(distance[judged] / arrival[judged], BULK)
    slowest, fastest = low / max(high / low, AGAIN), high * max(high / low, AGAIN)
    late, early = arrival - distance / slowest, arrival - distance / fastest
    return np.maximum(late, 0.0) + np.minimum(early, 0.0), (float(slowest), float(fastest))


def departures(dataset: Dataset, delta: Floats) -> tuple[Floats, Floats]:
    """Departure of each pick from the median of its neighbours, and how much these accept.

    They accept ``OUTLYING`` of their robust standard deviations, and as much as some of them depart: at the
    edge of the object most neighbours may have one time, and a few of them another. A pick that its
    reciprocal pair confirms must be far from all neighbours but one.

    Args:
        dataset, delta: as ``consistent`` takes them.

    Returns:
        (ntx, nrx) each, s; NaN departures where a pick or its neighbours are missing.
    """
    position, reverse = dataset.element_position_m, dataset.geometry.reverses(delta)
    emitters = _nearest(position[dataset.tx], NEAR_EMITTERS)
    receivers = _nearest(position[dataset.rx], NEAR_RECEIVERS)
    departure, accepted = np.empty((2, *delta.shape))
    step = max(1, TOGETHER // len(receivers))
    for first in range(0, len(emitters), step):
        rows = slice(first, first + step)
        around = _neighbours(delta, emitters[rows], receivers)
        departure[rows], accepted[rows] = _from_neighbours(delta[rows], reverse[rows], around)
    return departure, accepted


def _from_neighbours(delta: Floats, reverse: Floats, around: Floats) -> tuple[Floats, Floats]:
    """Like ``departures`` for the rows of some emitters, with their neighbours, which are overwritten."""
    count = np.isfinite(around).sum(axis=0)
    # Zeros avoid warnings of medians over columns without neighbours.
    around[:, count == 0] = 0.0
    middle = np.nanmedian(around, axis=0)
    departure = np.where(count >= 3, delta - middle, np.nan)
    np.abs(np.subtract(around, middle, out=around), out=around)
    accepted = OUTLYING * 1.4826 * np.nanmedian(around, axis=0)
    around[np.isnan(around)] = 0.0
    far = [-min(rank, len(around)) for rank in (FAR, CONFIRMED)]
    around.partition(far, axis=0)
    size = np.abs(departure)
    with np.errstate(invalid="ignore"):
        confirmed = np.abs(delta - reverse) <= AGREEING * size
    farthest = np.where(confirmed, BEYOND * around[far[1]], around[far[0]])
    return departure, np.maximum(accepted, farthest)


def usual_departure(dataset: Dataset, departure: Floats) -> float:
    """Largest usual departure of a pick, s; infinite without departures.

    ``CERTAIN`` standard deviations, by a quantile that a tenth of wrong picks hardly changes, and at least
    ``LEAST`` of the time through the water, for exact times.

    Args:
        dataset: with the geometry.
        departure: (ntx, nrx), s.
    """
    finite = np.isfinite(departure)
    if not finite.any():
        return math.inf
    time = float(dataset.distance_m()[finite].mean()) / dataset.water_speed_mps
    usual = float(np.quantile(np.abs(departure[finite]), USUAL)) / NORMAL
    return max(CERTAIN * usual, LEAST * time)


def unreciprocal(dataset: Dataset, delta: Floats, skip_s: float) -> Flags:
    """(ntx, nrx): picks that differ by more than ``skip_s`` from their reciprocal pair.

    Differences within ``CERTAIN`` robust standard deviations of all of them are noise.
    """
    difference = np.abs(delta - dataset.geometry.reverses(delta))
    finite = difference[np.isfinite(difference) & (dataset.tx[:, None] != dataset.rx)]
    noise = 1.4826 * float(np.median(finite)) if finite.size else 0.0
    with np.errstate(invalid="ignore"):
        return np.asarray(difference > max(skip_s, CERTAIN * noise))


def _neighbours(delta: Floats, emitters: Ints, receivers: Ints) -> Floats:
    """(pairs, rows, nrx) picks of the pairs of neighbouring elements, without the pick itself.

    Args:
        delta: (ntx, nrx), s.
        emitters, receivers: indices from ``_nearest`` for the rows and for all receivers.
    """
    near = [
        delta[np.ix_(emitters[:, e], receivers[:, r])]
        for e in range(emitters.shape[1])
        for r in range(receivers.shape[1])
        if e or r
    ]
    return np.stack(near or [np.full((len(emitters), len(receivers)), np.nan)])


def _nearest(position: Floats, count: int) -> Ints:
    count = min(count, len(position))
    nearest = KDTree(position).query(position, k=count)[1]
    return np.asarray(nearest, dtype=np.int64).reshape(len(position), count)

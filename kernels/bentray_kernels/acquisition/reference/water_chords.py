"""Chords that miss the object, and the line of arrival time over distance through them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Flags, Floats, Ints
from ...errors import InvalidInput
from ..dataset import Dataset
from ..noise import robust_deviation
from ..robust_line import robust_line

# Apparent speeds of coupling media that are searched, m/s: oil to salt water at 50 °C, and grid dispersion.
SLOWEST_MPS, FASTEST_MPS, SPEEDS = 1350.0, 1650.0, 301

# Width of a bin of the first search, periods: the maximum of an envelope scatters by less.
BIN = 0.05

# Shorter chords hold ringing, cross-talk and the near field: wavelengths, and at most a part of the longest.
NEAREST, NEAREST_PART = 8.0, 0.2

# Chords are examined from the edge of the array inwards, in groups of this part of all.
GROUP = 0.02

# The outermost chords are taken to miss the object, and further ones must agree with them: at least this part
# of all, over this part of the longest distance, so that they determine a line.
OUTERMOST, OUTERMOST_SPAN = 0.06, 0.1

# Distance from the first line within which the outermost chords are used, periods.
SEARCHED = 0.3

# The same where the outermost chords alone show the line.
CLOSELY = 0.1

# Largest distance from the line at which a chord agrees: robust deviations of the outermost chords, periods.
AGREEING, MIN_TOLERANCE = 4.0, 0.02

# Least part of a group that agrees; the search ends at the second group in a row with less.
MIN_FRACTION = 0.75

MIN_CHORDS = 24


@dataclass(frozen=True)
class WaterChords:
    """Chords through water alone, with arrival = delay + distance / speed.

    Attributes:
        pairs: (ntx, nrx), chords that miss the object.
        speed_mps: apparent speed of the coupling medium.
        delay_s: of the arrivals, with that of the pulse and of the recording's time zero.
        emission_delay_s, reception_delay_s: (ntx,), (nrx,), known delays of elements, s; None: 0.
    """

    pairs: Flags
    speed_mps: float
    delay_s: float
    emission_delay_s: Floats | None = None
    reception_delay_s: Floats | None = None

    def arrival_s(self, distance_m: Floats) -> Floats:
        """Arrival in water at a distance, s, without delays of elements."""
        return self.delay_s + distance_m / self.speed_mps

    def with_delays(self, emission_s: Floats, reception_s: Floats) -> WaterChords:
        """These chords with late elements, (ntx,) and (nrx,), s."""
        return replace(self, emission_delay_s=emission_s, reception_delay_s=reception_s)


def find_water_chords(dataset: Dataset, arrival_s: Floats, tolerance: float = MIN_TOLERANCE) -> WaterChords:
    """Find the chords that miss the object, without an assumption on its size.

    The line through most arrivals is searched among all plausible speeds. From the outermost chords inwards,
    groups of chords are added while they agree with the line through the previous ones.

    Args:
        dataset: of one slice, with a centre frequency.
        arrival_s: (ntx, nrx), s, NaN where unknown: of a scan with the object.
        tolerance: least distance from the line that agrees, periods.

    Raises:
        InvalidInput: where no such line exists: too few chords miss the object.
    """
    distance, period_s = dataset.distance_m(), 1.0 / dataset.frequency_hz
    nearest = min(NEAREST * dataset.water_speed_mps * period_s, NEAREST_PART * float(distance.max()))
    usable = np.isfinite(arrival_s) & (distance > nearest)
    usable &= dataset.tx[:, None] != dataset.rx[None, :]
    if dataset.valid is not None:
        usable &= dataset.valid
    pairs = np.flatnonzero(usable)
    if pairs.size < MIN_CHORDS:
        raise _refusal(pairs.size)
    x, y = distance.ravel()[pairs], arrival_s.ravel()[pairs]
    order = np.argsort(-chord_offset(dataset).ravel()[pairs], kind="stable")
    groups = _groups(order, x, OUTERMOST_SPAN * float(distance.max()))
    outermost = next(groups)
    agreeing = _near(_densest_line(x, y, BIN * period_s), x, y, outermost, SEARCHED * period_s)
    if agreeing.size < MIN_CHORDS:
        # Most chords may cross a large object of small contrast: then the outermost ones alone show the line,
        # if they agree closely.
        line = _densest_line(x[outermost], y[outermost], BIN * period_s)
        closely = _near(line, x, y, outermost, CLOSELY * period_s)
        agreeing = closely if closely.size >= MIN_FRACTION * outermost.size else agreeing
    if agreeing.size < MIN_CHORDS:
        raise _refusal(agreeing.size)
    slowness, delay = robust_line(x[agreeing], y[agreeing])
    spread = robust_deviation(y[agreeing] - slowness * x[agreeing])
    reach = max(AGREEING * spread, tolerance * period_s)
    misses = 0
    for group in groups:
        alike = group[np.abs(y[group] - delay - slowness * x[group]) <= reach]
        misses = misses + 1 if alike.size < MIN_FRACTION * group.size else 0
        if misses > 1:
            break
        if not misses:
            agreeing = np.concatenate((agreeing, alike))
            slowness, delay = robust_line(x[agreeing], y[agreeing])
    speed = 1.0 / slowness if slowness > 0.0 else float("inf")
    if not SLOWEST_MPS <= speed <= FASTEST_MPS:
        raise _refusal(agreeing.size)
    chosen = np.zeros(distance.size, dtype=bool)
    chosen[pairs[agreeing]] = True
    return WaterChords(chosen.reshape(distance.shape), speed, delay)


def chord_offset(dataset: Dataset) -> Floats:
    """Distance of chords from the axis of the array over that of the farthest element, (ntx, nrx)."""
    position = dataset.element_position_m[:, :2]
    centred = position - 0.5 * (position.min(axis=0) + position.max(axis=0))
    start = centred[dataset.tx][:, None]
    along = centred[dataset.rx][None] - start
    length = np.maximum((along**2).sum(axis=-1), np.finfo(np.float64).tiny)
    fraction = np.clip(-(start * along).sum(axis=-1) / length, 0.0, 1.0)
    nearest = np.linalg.norm(start + fraction[..., None] * along, axis=-1)
    return np.asarray(nearest / np.linalg.norm(centred, axis=1).max())


def _near(line: tuple[float, float], x: Floats, y: Floats, chords: Ints, reach: float) -> Ints:
    """The chords within a distance, s, of a line of slowness and delay."""
    slowness, delay = line
    return np.asarray(chords[np.abs(y[chords] - delay - slowness * x[chords]) <= reach])


def _densest_line(x: Floats, y: Floats, width: float) -> tuple[float, float]:
    """Slowness and delay of the line, of all plausible slownesses, near which most points lie."""
    most, best = -1.0, (0.0, 0.0)
    for slowness in 1.0 / np.linspace(SLOWEST_MPS, FASTEST_MPS, SPEEDS):
        delay = y - slowness * x
        least = float(np.percentile(delay, 0.5))
        index = np.floor((delay - least) / width)
        inside = (index >= 0.0) & (index < 1e5)
        near = np.convolve(np.bincount(index[inside].astype(np.int64)), (0.5, 1.0, 0.5), "same")
        peak = int(near.argmax())
        if near[peak] > most:
            most, best = float(near[peak]), (float(slowness), least + (peak + 0.5) * width)
    return best


def _groups(order: Ints, x: Floats, span: float) -> Iterator[Ints]:
    """Chords from the edge of the array inwards: the outermost ones, over a span, then small groups."""
    reached = np.maximum.accumulate(x[order]) - np.minimum.accumulate(x[order])
    first = max(MIN_CHORDS, int(OUTERMOST * order.size), int(np.searchsorted(reached, span)) + 1)
    size = max(MIN_CHORDS, int(GROUP * order.size))
    yield order[:first]
    for begin in range(first, order.size, size):
        yield order[begin : begin + size]


def _refusal(chords: int) -> InvalidInput:
    return InvalidInput(
        "waveform/water",
        f"no traces, and {chords} chords of the object scan that pass through water alone",
        "a scan without the object (waveform/water) or travel times (traveltime/delta_tof_s), if the object "
        f"fills the array; else at least {MIN_CHORDS} chords that miss it, "
        f"at {SLOWEST_MPS:g} to {FASTEST_MPS:g} m/s",
    )

"""Travel times that no sound can have, in which other programs write missing ones: they become NaN."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..arrays import Flags, Floats, Ints
from .noise import robust_deviation

# Slowest sound across the whole array, m/s: a later time is none.
SLOWEST_MPS = 300.0

# Numbers that stand for a missing value, in the units that a scan may have been converted from.
PLACEHOLDERS = (-1.0, -9.0, -99.0, -999.0, -9999.0, -99999.0, 99.0, 999.0, 9999.0, 99999.0)
UNITS = (1.0, 1e-3, 1e-6, 1e-9)

# A placeholder occurs at least so often, and lies outside these percentiles of the other times by this part
# of their range, where it is so many times as frequent as all others.
REPEATED, OUTSIDE, MARGIN, ALONE = 3, (2.0, 98.0), 0.1, 3.0

# If more than this part of the times would be too late or too early, the unit is wrong instead, and the scan
# is refused elsewhere. Half a matrix has impossible times in half of it.
MOST = 0.6

# A difference of 0 contradicts that of the other direction beyond so many standard deviations of directions.
CERTAIN = 5.0

# Fewest pairs measured in both directions from which this deviation is known; without them, this part of the
# zeros lies on one side of the diagonal.
MIN_BOTH, ONE_TRIANGLE = 30, 0.9

# Rounding of a placeholder.
SAME = 1e-6

# Half a matrix of arrivals has at least this part of its times impossible.
HALF = 0.35

# Directions agree if they deviate by less than this part of the large differences.
AGREEING = 0.1

# Arrivals within this part of the time through water are as good as at time zero.
AT_ONCE = 1e-3

# Elements nearer than this part of the width of the array are at the same place, and have time 0.
SAME_PLACE = 1e-6

INFINITE, MASKED = "infinite", "masked"
AT_ZERO, TOO_LATE, TOO_EARLY = "zero or negative", "later than any sound", "before the emission"
PLACEHOLDER, ONE_WAY = "placeholders", "zero where the other direction is not"


@dataclass(frozen=True)
class Geometry:
    """Which elements the times are between.

    Attributes:
        position_m: (elements, 2 or 3), m.
        tx, rx: (ntx,), (nrx,) indices.
        water_speed_mps: of the water, m/s.
    """

    position_m: Floats
    tx: Ints
    rx: Ints
    water_speed_mps: float

    def distance_m(self, e: int) -> Floats:
        """Distances of the receivers of an emission, (nrx,), m; NaN for the emitter itself and its place."""
        away = np.linalg.norm(self.position_m[self.rx] - self.position_m[self.tx[e]], axis=1)
        away[(self.rx == self.tx[e]) | (away <= SAME_PLACE * self.width_m)] = np.nan
        return np.asarray(away)

    def reverses(self, values: Floats) -> Floats:
        """Values of the other direction of each pair, (ntx, nrx); NaN where it was not measured."""
        at_tx, at_rx = (np.full(len(self.position_m), -1) for _ in range(2))
        at_tx[self.tx], at_rx[self.rx] = np.arange(len(self.tx)), np.arange(len(self.rx))
        back_e, back_r = at_tx[self.rx], at_rx[self.tx]
        both = (back_e >= 0)[None, :] & (back_r >= 0)[:, None]
        both &= self.tx[:, None] != self.rx[None, :]
        return np.where(both, values[back_e[None, :], back_r[:, None]], np.nan)

    @property
    def width_m(self) -> float:
        """Diagonal of the array, m; no two elements are farther apart."""
        return float(np.linalg.norm(np.ptp(self.position_m, axis=0)))


def without_impossible(
    times: Floats, geometry: Geometry, *, absolute: bool
) -> tuple[Floats, Mapping[str, int]]:
    """Replace impossible travel times by NaN.

    Args:
        times: ([nz,] ntx, nrx), s; a masked array too.
        geometry: of the scan.
        absolute: arrivals after the emission, not differences to those in water.

    Returns:
        The times, the same array if nothing was impossible, and the number of each kind. Times of an element
        to itself are left as they are. Where most times seem impossible, the unit is wrong, and they stay.
    """
    counts: dict[str, int] = {}
    read = times
    if isinstance(times, np.ma.MaskedArray):
        read = np.ma.filled(times.astype(np.float64), np.nan)
        counts[MASKED] = int(np.ma.getmaskarray(times).sum())
    elif times.dtype.kind in "iu":
        read = times.astype(np.float64)
    infinite = np.isinf(read)
    if infinite.any():
        counts[INFINITE] = int(infinite.sum())
        read = np.where(infinite, np.nan, read)
    stacked = read[None] if read.ndim == 2 else read
    for kind, flags in _impossible(stacked, geometry, absolute=absolute):
        counts[kind] = counts.get(kind, 0) + int(flags.sum())
        stacked = np.where(flags, np.nan, stacked)
    read = stacked[0] if read.ndim == 2 else stacked
    kept = {kind: count for kind, count in counts.items() if count}
    return (read if kept or read is not times else times), kept


def _impossible(times: Floats, geometry: Geometry, *, absolute: bool) -> Iterator[tuple[str, Flags]]:
    """Flags of each kind in turn, of (nz, ntx, nrx) times."""
    least, most = np.fmin.reduce(times, axis=None), np.fmax.reduce(times, axis=None)
    if not np.isfinite(least):
        return
    latest = geometry.width_m / SLOWEST_MPS
    earliest = 0.0 if absolute else -geometry.width_m / geometry.water_speed_mps
    flags = np.zeros(times.shape, dtype=bool)
    if most > latest:
        flags = times > latest
    if least < earliest and not absolute:
        flags |= times < earliest
    if flags.any():
        late = flags & (times > 0.0)
        # Differences of 0, beside a small object, are right in every unit.
        if flags.sum() <= MOST * (np.isfinite(times) & (times != 0.0)).sum():
            yield from (
                (kind, pairs) for kind, pairs in ((TOO_LATE, late), (TOO_EARLY, flags & ~late)) if pairs.any()
            )
        else:
            return
        times = np.where(flags, np.nan, times)
    nearest = 0.0 if absolute else _nearest(geometry)
    if least <= -nearest:
        early = _at_once(times, geometry, absolute=absolute)
        if early.any() and early.sum() <= MOST * np.isfinite(times).sum():
            half = [
                flags.sum() >= HALF * np.isfinite(plane).sum() and _is_half(flags, plane, geometry)
                for flags, plane in zip(early, times, strict=True)
            ]
            once = early & np.array(half)[:, None, None]
            yield ONE_WAY, once
            yield (AT_ZERO if absolute else TOO_EARLY), early & ~once
            times = np.where(early, np.nan, times)
    held = _placeholders(times)
    if held.any():
        yield PLACEHOLDER, held
        times = np.where(held, np.nan, times)
    if not absolute and least <= 0.0 <= most:
        zero = np.stack([_one_way(plane, geometry) for plane in times])
        if zero.any():
            yield ONE_WAY, zero


def _nearest(geometry: Geometry) -> float:
    """A lower bound of the time between two elements in water, s: that of the nearest ones of a sample."""
    distances = (geometry.distance_m(e) for e in range(len(geometry.tx)))
    nearest = min((float(np.nanmin(d)) for d in distances if np.isfinite(d).any()), default=0.0)
    return nearest / geometry.water_speed_mps * (1.0 - AT_ONCE)


def _at_once(times: Floats, geometry: Geometry, *, absolute: bool) -> Flags:
    """Arrivals at the time of the emission or before."""
    flags = np.zeros(times.shape, dtype=bool)
    for e in range(len(geometry.tx)):
        through_water = geometry.distance_m(e) / geometry.water_speed_mps
        arrival = times[:, e] if absolute else times[:, e] + through_water
        flags[:, e] = (arrival <= (0.0 if absolute else AT_ONCE * through_water)) & np.isfinite(through_water)
    return flags


def _placeholders(times: Floats) -> Flags:
    """Repeated numbers that programs write for a missing value, outside the range of the others."""
    flags = np.zeros(times.shape, dtype=bool)
    finite = times[np.isfinite(times)]
    if not finite.size:
        return flags
    for unit in UNITS:
        for number in PLACEHOLDERS:
            value = number * unit
            low, high = sorted((value * (1.0 - SAME), value * (1.0 + SAME)))
            # Without arrays of floating-point numbers, since scans are large and most have no placeholder.
            if ((finite >= low) & (finite <= high)).sum() < REPEATED:
                continue
            same = (times >= low) & (times <= high)
            if same.sum() == finite.size:
                continue
            others = times[np.isfinite(times) & ~same & ~flags]
            low, high = np.percentile(others, OUTSIDE)
            margin = MARGIN * (high - low)
            beyond = others < low - margin if value < low - margin else others > high + margin
            if not low - margin <= value <= high + margin and same.sum() > ALONE * beyond.sum():
                flags |= same
    return flags


def _is_half(flags: Flags, times: Floats, geometry: Geometry) -> bool:
    """Whether flags mark one half of a matrix, whose pairs have times in the other half."""
    e, r = np.nonzero(flags)
    if not e.size:
        return False
    above = float((geometry.tx[e] < geometry.rx[r]).mean())
    other = np.isfinite(geometry.reverses(np.where(flags, np.nan, times))[flags]).mean()
    return bool(max(above, 1.0 - above) >= ONE_TRIANGLE and other >= ONE_TRIANGLE)


def _one_way(times: Floats, geometry: Geometry) -> Flags:
    """(ntx, nrx): differences of 0 of pairs whose other direction says otherwise."""
    none = np.zeros(times.shape, dtype=bool)
    zero = (times == 0.0) & (geometry.tx[:, None] != geometry.rx[None, :])
    if not zero.any() or not (times != 0.0).any():
        return none
    reverse = geometry.reverses(times)
    off = np.where(np.isfinite(times) & np.isfinite(reverse), times - reverse, np.nan)
    contrary = zero & (np.abs(off) > 0.0)
    measured = np.isfinite(off) & ~zero & (reverse != 0.0)
    allowed = 0.0
    if measured.sum() >= MIN_BOTH:
        deviation = robust_deviation(off[measured])
        if deviation > AGREEING * float(np.percentile(np.abs(times[measured]), 90.0)):
            # Directions disagree anyway: the order of the elements is wrong, or noise is strong.
            return none
        # Times in coarse steps differ by one or two of them.
        allowed = max(CERTAIN * deviation, 2.5 * _step(times[np.isfinite(times) & (times != 0.0)]))
    elif not _is_half(contrary, times, geometry):
        return none
    return np.asarray(contrary & (np.abs(off) > allowed))


def _step(times: Floats) -> float:
    """The step of which all times are multiples, s; 0 without one."""
    sizes = np.unique(np.abs(times))
    ratios = sizes / sizes[0]
    return float(sizes[0]) if np.abs(ratios - np.rint(ratios)).max() < 0.01 else 0.0


def lost_pairs(counts: Mapping[str, int]) -> int:
    """Number of pairs without a time in either direction, of those with impossible times."""
    return sum(count for kind, count in counts.items() if kind != ONE_WAY)


def impossible_words(counts: Mapping[str, int]) -> str:
    """The numbers of impossible times in words; empty for none."""
    return ", ".join(f"{number} {kind}" for kind, number in counts.items())

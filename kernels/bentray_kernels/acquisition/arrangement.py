"""Arrival times against the positions of their elements: do they fit, and does another order fit better."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from ..arrays import Flags, Floats, Ints
from ..errors import InvalidInput
from .dataset import Dataset
from .impossible_times import AT_ZERO

# Emissions and receivers that are compared: to search among all orders, and to judge the best of them.
SEARCHED, JUDGED = (6, 64), (48, 192)

# Orders that are judged after the search.
FINALISTS = 48

# Pairs nearer than this part of the width of the array are ignored, because picks of neighbours are often
# wrong; up to the second part chords usually miss the object.
NEAR, SHORT = 0.05, 0.4

# Fewest pairs of a measure.
MIN_PAIRS = 20

# Fewest differences that an order is judged by: they say less than absolute times.
MIN_DIFFERENCES = 200

# Another order must reduce a residual to this part, beyond this many standard deviations, and raise no other
# one by more than the third number; it must be better than all others by the fourth.
BETTER, CERTAIN, WORSE, CLEARLY = 0.5, 6.0, 1.25, 0.8

# Orders whose logarithm is as near to the best one are compared by means; of absolute times the best one must
# leave less than this part of the mean residual.
NEARLY, EXPLAINED = 1.0, 0.25

# Of absolute times this part of the residuals is smaller than their size: many picks may be anywhere.
PART = 0.65

# Standard deviation of the logarithm of such a size, of normally distributed values, times the root of their
# number.
MEDIAN_SIGMA = 1.1

# A scan is right without a search if its residual is below this part of that of shuffled times, or short
# chords have less than this part of the spread of all; and directions differ less than this part of
# neighbours.
RELATED, SHORT_RIGHT, RECIPROCAL = 0.1, 0.3, 0.6

# Arrangements that are compared at once, and shifts of a list that are tried in each direction.
BATCH, MOST_SHIFTS = 256, 512

# Smallest measure that is distinguished from zero, as a part of the spread of the times.
LEAST = 3e-3

# Times are unrelated to the positions if their residual is at least this part of that of shuffled times.
UNRELATED = 0.6

# Least spread of the distances, over their median, that such a comparison needs.
MIN_SPREAD = 0.3

# Apparent sound speeds between which the times of most pairs are, m/s.
SLOWEST_MPS, FASTEST_MPS = 300.0, 6_000.0

ELEMENTS, EMITTERS, RECEIVERS, POSITIONS = "elements", "emitters", "receivers", "positions"


@dataclass(frozen=True)
class Arrangement:
    """Which element each emission and reception of a scan belongs to, and where the elements are.

    Attributes:
        name: as ``bentray correct --arrangement`` takes it; empty for that of the scan.
        tx, rx: (ntx,), (nrx,), indices of elements.
        position_m: (elements, 2 or 3), m.
    """

    name: str
    tx: Ints
    rx: Ints
    position_m: Floats

    @property
    def words(self) -> str:
        """The fault of the scan in words."""
        return self.name.replace("-", " ")


@dataclass(frozen=True)
class Mismatch:
    """Times that do not fit the positions.

    Attributes:
        found: the numbers.
        proposal: the arrangement that explains the times; None where no single one does.
    """

    found: str
    proposal: Arrangement | None


def rearranged(dataset: Dataset, name: str) -> Dataset:
    """The scan in another arrangement: its data stay, and belong to other elements.

    Args:
        dataset: the scan.
        name: of the fault, such as ``receivers-shifted-by-1``; see ``arrangements``.

    Raises:
        InvalidInput: for a name that is none, or does not apply to the array.
    """
    for order in arrangements(dataset):
        if order.name == name:
            counts = _without_own(dataset, order)
            changes = {"tx": order.tx, "rx": order.rx, "element_position_m": order.position_m}
            return replace(dataset, **changes, impossible_times=counts)  # type: ignore[arg-type]
    accepted = (
        "emitters-, receivers- or elements- with reversed, shifted-by-N, reversed-shifted-by-N, grid-…, "
        "by-angle or odd-even, or positions-in-degrees, positions-in-radians, positions-transposed; as the "
        "refusal of the scan proposes it"
    )
    raise InvalidInput("arrangement", repr(name)[:60], accepted)


def _without_own(dataset: Dataset, arrangement: Arrangement) -> dict[str, int]:
    """Numbers of impossible times without those of an element to itself, which are rightly 0."""
    counts = dict(dataset.impossible_times)
    if dataset.tof_s is not None and AT_ZERO in counts:
        own = arrangement.tx[:, None] == arrangement.rx[None, :]
        counts[AT_ZERO] -= int((own & np.isnan(dataset.tof_s)).sum())
    return {kind: count for kind, count in counts.items() if count > 0}


def arrangements(dataset: Dataset) -> Iterator[Arrangement]:
    """All arrangements of the family, those of the whole array and of one side of it, simplest first."""
    tx, rx, position = dataset.tx, dataset.rx, dataset.element_position_m
    every = np.arange(len(position))
    for name, move in POSITION_FAULTS.items():
        moved = move(position)
        if moved is not None:
            yield Arrangement(f"{POSITIONS}-{name}", tx, rx, moved)
    turns = np.array_equal(tx, rx) and np.array_equal(tx, every) and _turns(position)
    for name, order in orders(position):
        # A common turn of a regular ring changes nothing.
        if not (turns and "shifted" in name):
            yield Arrangement(f"{ELEMENTS}-{name}", order[tx], order[rx], position)
    # There, emitters in another order are receivers in another order.
    sides = ((RECEIVERS, rx),) if turns else ((RECEIVERS, rx), (EMITTERS, tx))
    for side, own in sides:
        listed = [(name, own[order]) for name, order in orders(position[own])]
        if not np.array_equal(own, every):
            listed += [(f"{name}-of-all", order[own]) for name, order in orders(position)]
        for name, changed in listed:
            both = (tx, changed) if side == RECEIVERS else (changed, rx)
            yield Arrangement(f"{side}-{name}", *both, position)
    if len(tx) == len(rx) and not np.array_equal(tx, rx):
        yield Arrangement("emitters-and-receivers-exchanged", rx, tx, position)


def _turns(position: Floats) -> bool:
    """Whether the array turns into itself from each element to the next."""
    first, last = position[0], position[-1]
    step, near = np.roll(position, 1, axis=0), 1e-6 * float(np.ptp(position, axis=0).max())
    offsets = [
        np.linalg.norm(points - origin, axis=1) for points, origin in ((position, first), (step, last))
    ]
    return bool(np.abs(np.subtract(*offsets)).max() < near) and bool(
        np.ptp(np.linalg.norm(position - step, axis=1)) < near
    )


def orders(position: Floats) -> Iterator[tuple[str, Ints]]:
    """Orders in which elements are listed by mistake: entry ``k`` of the data is of element ``order[k]``.

    Args:
        position: (elements, 2 or 3) of those on one side, in the order of the file.
    """
    count = len(position)
    every = np.arange(count)
    yield "reversed", every[::-1]
    for k in _shifts(count):
        yield f"shifted-by-{_signed(k)}", np.roll(every, k)
    for k in _shifts(count):
        yield f"reversed-shifted-by-{_signed(k)}", np.roll(every[::-1], k)
    yield from _with_inverse("odd-even", np.concatenate((every[::2], every[1::2])))
    for name, order in _grid_orders(position):
        yield from _with_inverse(name, order)
    offset = position[:, :2] - position[:, :2].mean(axis=0)
    around = np.argsort(np.round(np.arctan2(offset[:, 1], offset[:, 0]), 9), kind="stable")
    if not np.array_equal(np.diff(around) % max(count, 1), np.ones(max(count - 1, 0))):
        for k in (0, *_shifts(count)):
            yield from _with_inverse(f"by-angle-from-{_signed(k)}", np.roll(around, -k))


def _signed(number: int) -> str:
    return str(number) if number >= 0 else f"minus-{-number}"


def _shifts(count: int) -> list[int]:
    """All shifts of a list, smallest first."""
    half = count // 2
    shifts = (k for k in range(-half + 1 - count % 2, half + 1) if 0 < abs(k) <= MOST_SHIFTS)
    return sorted(shifts, key=abs)


def _with_inverse(name: str, order: Ints) -> Iterator[tuple[str, Ints]]:
    yield name, order
    yield f"{name}-inverse", np.argsort(order, kind="stable")


def _grid_orders(position: Floats) -> Iterator[tuple[str, Ints]]:
    """Orders in which a grid stores the elements: by rows or columns, from either end of each axis."""
    axes = tuple(range(position.shape[1]))
    width = float(np.ptp(position, axis=0).max())
    # Elements of a mask lie on its nodes, so that small differences within a row do not count.
    steps = {"": 1e-6 * width, "-on-nodes": 0.5 * _pitch(position)}
    for ending, step in steps.items():
        rounded = np.round(position / step) if step > 0.0 else position
        # The axis that counts most is the last one of the masks of MATLAB, which is the usual case.
        for signs in product((1, -1), repeat=2) if len(axes) == 2 else ((1, 1, 1),):
            for keys in permutations(reversed(axes)):
                signed = list(zip(keys, signs, strict=True))
                names = "".join(f"{'minus' if s < 0 else ''}{'xyz'[a]}" for a, s in signed)
                yield f"grid-{names}{ending}", np.lexsort([s * rounded[:, a] for a, s in reversed(signed)])


def _pitch(position: Floats) -> float:
    """Usual distance of consecutive elements, m."""
    return float(np.median(np.linalg.norm(np.diff(position, axis=0), axis=1))) if len(position) > 1 else 0.0


def _with_angles(position: Floats, factor: float) -> Floats | None:
    """Positions on a circle with the angles multiplied; None where they are on no circle.

    The given angles are known up to turns. Between consecutive elements the step is taken that is nearest to
    an even division of the circle; the angle of the first element remains unknown by such a turn, which only
    turns the image.
    """
    flat = position[:, :2]
    # The circle through the elements, by least squares.
    system = np.column_stack((2.0 * flat, np.ones(len(flat))))
    solution, _, rank, _ = np.linalg.lstsq(system, (flat**2).sum(axis=1), rcond=None)
    if rank < 3:
        return None
    centre = solution[:2]
    offset = flat - centre
    radius = np.linalg.norm(offset, axis=1)
    if np.ptp(radius) > 1e-3 * radius.mean():
        return None
    angle = np.arctan2(offset[:, 1], offset[:, 0])
    even = 2.0 * math.pi / len(position) / factor
    step = np.diff(angle)
    step += 2.0 * math.pi * np.round((even - step) / (2.0 * math.pi))
    right = factor * np.concatenate(([angle[0]], angle[0] + np.cumsum(step)))
    moved = position.copy()
    moved[:, :2] = centre + radius[:, None] * np.column_stack((np.cos(right), np.sin(right)))
    return moved


def _transposed(position: Floats) -> Floats:
    """Coordinates that were stored axis by axis and read element by element."""
    return np.ascontiguousarray(position.reshape(position.shape[::-1]).T)


# By the fault of positions, the right ones: angles in degrees were taken as radians, or the other way round.
POSITION_FAULTS: Mapping[str, Callable[[Floats], Floats | None]] = {
    "in-degrees": partial(_with_angles, factor=math.radians(1.0)),
    "in-radians": partial(_with_angles, factor=math.degrees(1.0)),
    "transposed": _transposed,
}


class _Times:
    """The times of one slice, and their fit to arrangements.

    The fit of an arrangement are the sizes of four residuals, s: of the times along the distances, of short
    chords, of the two directions of a pair, and of neighbouring receivers; NaN without enough pairs. In
    differences an object may be small, so that medians do not see it.
    """

    def __init__(self, dataset: Dataset) -> None:
        self.given = Arrangement("", dataset.tx, dataset.rx, dataset.element_position_m)
        self.absolute = dataset.tof_s is not None
        times = dataset.tof_s if self.absolute else dataset.delta_tof_s
        assert times is not None
        self.times = times if dataset.valid is None else np.where(dataset.valid, times, np.nan)
        self.water_mps = dataset.water_speed_mps
        finite_times = self.times[np.isfinite(self.times)]
        self.count = finite_times.size
        off = np.abs(finite_times - np.median(finite_times)) if finite_times.size else np.zeros(1)
        # Wrong picks are cut off; an object that few chords cross is not.
        self.most = float(next((x for x in np.percentile(off, (90.0, 95.0, 98.0)) if x > 0.0), 0.0))
        self.spread = float(np.minimum(off, self.most).mean())
        self.least = LEAST * self.spread

    def fits(self, tried: Sequence[Arrangement], most: tuple[int, int]) -> _Measure:
        """The fits of arrangements with the same positions.

        Args:
            tried: the arrangements.
            most: emissions and receivers that are compared, evenly spaced.
        """
        position = tried[0].position_m
        e, r = (_evenly(n, m) for n, m in zip(self.times.shape, most, strict=True))
        tx, rx = np.stack([order.tx for order in tried]), np.stack([order.rx for order in tried])
        sent, heard = tx[:, e], rx[:, r]
        times = self.times[np.ix_(e, r)]
        distance = _distance(position, sent, heard)
        width = float(np.ptp(position, axis=0).max())
        usable = np.isfinite(times) & (distance > NEAR * width)
        late, slope = self._lateness(distance, usable, times)
        short = np.where(distance <= SHORT * width, late, np.nan)
        # The same pairs in the other direction, if they were measured.
        at_tx, at_rx = _indices_in(tx, len(position)), _indices_in(rx, len(position))
        row = np.arange(len(tried))[:, None]
        back_e, back_r = at_tx[row, heard][:, None, :], at_rx[row, sent][:, :, None]
        both = (back_e >= 0) & (back_r >= 0) & (sent[:, :, None] != heard[:, None, :])
        reverse = np.where(both, times - self.times[back_e, back_r], np.nan)
        nearest = _neighbours(position, tried[0].rx)[heard]
        at = at_rx[row, nearest]
        expected = slope * _distance(position, sent, nearest)
        late_beside = self.times[e[None, :, None], at[:, None, :]] - expected
        residuals = (late, short, reverse, late - late_beside)
        measures = [_measure(values, self.most, median=self.absolute) for values in residuals]
        if not self.absolute:
            # Not about their own middle: those of another order may be large and alike.
            measures[1] = _measure(short, self.most, median=False, about=0.0)
        fit = _Measure(*(np.stack(column, axis=1) for column in zip(*measures, strict=True)))
        if not self.absolute:
            # A rearrangement does not change the residuals of differences as a whole.
            fit.typical[:, 0] = np.nan
        return fit

    def _slownesses(self, distance: Floats, times: Floats) -> list[float]:
        """Slownesses along which absolute times may grow, s/m: that of the water, and another one.

        The other one relates the quantiles of times to those of distances, whatever their order; many wrong
        times spoil it.
        """
        if not self.absolute:
            return [0.0]
        water = 1.0 / self.water_mps
        percents = np.linspace(5.0, 95.0, 19)
        x, y = (np.percentile(values, percents) for values in (distance, times))
        x, y = x - x.mean(), y - y.mean()
        slope = float(x @ y) / max(float(x @ x), 1e-30)
        return [water, min(max(slope, 1.0 / FASTEST_MPS), 1.0 / SLOWEST_MPS)]

    def _lateness(self, distance: Floats, usable: Flags, times: Floats) -> tuple[Floats, Floats]:
        """Times minus those along the better one of two slownesses, and the slowness of each arrangement."""
        late, best = np.full(distance.shape, np.nan), np.full(len(distance), np.inf)
        chosen = np.zeros(len(distance))
        whole = usable[0]
        pairs = (distance[0][whole], times[whole]) if whole.any() else (np.ones(1), np.ones(1))
        for slowness in self._slownesses(*pairs):
            off = np.where(usable, times - slowness * distance, np.nan)
            size = np.nan_to_num(_measure(off, self.most, median=True).typical, nan=np.finfo(np.float64).max)
            better = size < best
            late[better], best[better], chosen[better] = off[better], size[better], slowness
        return late, chosen[:, None, None]

    def step(self) -> float:
        """Usual difference of the times of neighbouring receivers by their distances, s."""
        e, r = (_evenly(n, m) for n, m in zip(self.times.shape, SEARCHED, strict=True))
        given = self.given
        nearest = _neighbours(given.position_m, given.rx)[given.rx[r]]
        sent = given.tx[None, e]
        near, far = (_distance(given.position_m, sent, heard[None]) for heard in (given.rx[r], nearest))
        return float(np.median(np.abs(near - far))) / self.water_mps

    def unrelated(self) -> float:
        """Residual over that of shuffled times; NaN where distances or pairs do not suffice."""
        e, r = (_evenly(n, m) for n, m in zip(self.times.shape, JUDGED, strict=True))
        distance = _distance(self.given.position_m, self.given.tx[None, e], self.given.rx[None, r])
        times = self.times[np.ix_(e, r)]
        usable = np.isfinite(times) & (distance > NEAR * distance.max(initial=0.0))
        x, y = distance[usable], times[usable[0]]
        if not self.absolute or x.size < 2 * MIN_PAIRS:
            return math.nan
        low, middle, high = np.percentile(x, (10.0, 50.0, 90.0))
        if high - low < MIN_SPREAD * middle:
            return math.nan
        # A fixed shuffle, so that the verdict does not change from run to run.
        mixed = np.random.default_rng(0).permutation(y)
        sizes = (
            [_measure(v[None] - slope * x, np.inf, median=True).typical[0] for v in (y, mixed)]
            for slope in self._slownesses(x, y)
        )
        return min(float(size / of_mixed) for size, of_mixed in sizes)


def find_mismatch(dataset: Dataset) -> Mismatch | None:
    """Compare the times of one slice with the positions, in the order of the file and in all others.

    Absolute times grow with the distance. Short chords usually miss the object, times agree in both
    directions, and with those of neighbours: this holds for differences too. No common turn or mirror image
    of a symmetric array changes any of these: it only turns the image, and is not found.

    Args:
        dataset: of one slice, with travel times.

    Returns:
        None where the order of the file is as good as any other.
    """
    times = _Times(dataset)
    if times.spread == 0.0 or (not times.absolute and times.count < MIN_DIFFERENCES):
        return None
    unrelated = times.unrelated()
    before = times.fits([times.given], JUDGED)
    if _surely_right(times, unrelated, before.typical[0]):
        return None
    ranked = sorted(_ranked(times, dataset), key=lambda row: row[:2])
    finalists = [(number, arrangement) for _, number, arrangement in ranked[:FINALISTS]]
    judged = []
    for number, arrangement in finalists:
        after = times.fits([arrangement], JUDGED)
        gain = _gains(before, after, times.least)
        if gain.accepted[0]:
            judged.append((-float(gain.total[0]), number, arrangement, after))
    if judged and (named := _named(times, before, judged)):
        return named
    if unrelated > UNRELATED:
        return Mismatch(f"{_numbers(before, None)}, {100 * unrelated:.0f} % of that of shuffled times", None)
    return None


def _surely_right(times: _Times, unrelated: float, typical: Floats) -> bool:
    """Whether no search is needed: directions agree, and times follow the distances."""
    _, short, reciprocity, neighbours = typical
    if times.absolute:
        return bool(unrelated < RELATED and reciprocity < RECIPROCAL * times.step())
    return bool(short < SHORT_RIGHT * times.spread and reciprocity < RECIPROCAL * neighbours)


def _ranked(times: _Times, dataset: Dataset) -> Iterator[tuple[float, int, Arrangement]]:
    """Arrangements that may be better than that of the scan, with minus their gain and their number."""
    before = times.fits([times.given], SEARCHED)
    for numbers, batch in _batches(arrangements(dataset)):
        gain = _gains(before, times.fits(batch, SEARCHED), times.least)
        yield from (
            (-float(gain.total[k]), numbers[k], batch[k]) for k in np.flatnonzero(gain.promising).tolist()
        )


class _Gains(NamedTuple):
    """By how much arrangements fit better: sums of logarithms, and whether they are judged and named."""

    total: Floats
    promising: Flags
    accepted: Flags


def _gains(before: _Measure, after: _Measure, least: float) -> _Gains:
    """Compare the fit of one arrangement with those of others."""
    finite = np.isfinite(before.typical) & np.isfinite(after.typical)
    logs = np.log(np.fmax(before.typical, least) / np.fmax(after.typical, least))
    sigma = np.hypot(before.sigma, after.sigma)
    certain = finite & (logs > np.fmax(-math.log(BETTER), CERTAIN * sigma))
    logs = np.where(finite, logs, 0.0)
    total = logs.sum(axis=1)
    promising = certain.any(axis=1) & (total > 0.0)
    return _Gains(total, promising, promising & (logs > -math.log(WORSE)).all(axis=1))


def _named(
    times: _Times, before: _Measure, judged: list[tuple[float, int, Arrangement, _Measure]]
) -> Mismatch | None:
    """The best arrangement, unless another one with other distances is about as good, or none is good."""
    best_loss = min(loss for loss, *_ in judged)
    # Medians do not see a few wrong places, which means do.
    near = [
        (_mean(after), number, order, after)
        for loss, number, order, after in judged
        if loss < best_loss + NEARLY
    ]
    least, _, best, after = min(near, key=lambda row: row[:2])
    rivals = [order for mean, _, order, _ in near if mean * CLEARLY <= least and not _alike(order, best)]
    if times.absolute and after.mean[0, 0] > EXPLAINED * before.mean[0, 0]:
        return None
    if rivals:
        message = _numbers(before, after, "in several other orders of the elements about")
        return Mismatch(message, None)
    # The simplest of those that are the same.
    same = next(
        order
        for _, _, order, _ in sorted(near, key=lambda row: row[1])
        if order is best or _alike(order, best)
    )
    message = _numbers(before, after, f"with {same.words} set right")
    return Mismatch(message, same)


def _mean(fit: _Measure) -> float:
    """Geometric mean of the mean residuals."""
    return float(np.exp(np.nanmean(np.log(np.maximum(fit.mean, 1e-15)))))


def _alike(first: Arrangement, other: Arrangement) -> bool:
    """Whether two arrangements have the same distances."""
    pair = [_distance(a.position_m, a.tx[None], a.rx[None])[0] for a in (first, other)]
    return bool(np.abs(np.subtract(*pair)).max() < 1e-6 * float(np.ptp(first.position_m, axis=0).max()))


# What each residual is, in words.
RESIDUALS = (
    "times are off the distances by",
    "times of short chords are off by",
    "the two directions of pairs differ by",
    "times of neighbours differ by",
)


def _numbers(before: _Measure, after: _Measure | None, what: str = "") -> str:
    """The residual that decides, before and after a rearrangement, in words; without one, the first."""
    sizes = before.typical[0]
    if after is None:
        kind = int(np.flatnonzero(np.isfinite(sizes))[0])
        return f"{RESIDUALS[kind]} {1e6 * sizes[kind]:.3g} µs"
    right = after.typical[0]
    floor = np.nanmax(sizes) * 1e-6
    ratio = np.fmax(sizes, floor) / np.fmax(right, floor)
    kind = int(np.nanargmax(np.where(np.isfinite(sizes) & np.isfinite(right), ratio, np.nan)))
    return f"{RESIDUALS[kind]} {1e6 * sizes[kind]:.3g} µs, {what} {1e6 * max(right[kind], floor):.2g} µs"


def _batches(listed: Iterable[Arrangement]) -> Iterator[tuple[list[int], list[Arrangement]]]:
    """Arrangements with the same positions, together, with their numbers."""
    numbers: list[int] = []
    batch: list[Arrangement] = []
    for number, arrangement in enumerate(listed):
        if batch and (len(batch) == BATCH or arrangement.position_m is not batch[0].position_m):
            yield numbers, batch
            numbers, batch = [], []
        numbers.append(number)
        batch.append(arrangement)
    if batch:
        yield numbers, batch


def _evenly(count: int, most: int) -> Ints:
    """At most so many indices, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


def _distance(position: Floats, sent: Ints, heard: Ints) -> Floats:
    """Distances of elements, (arrangements, emissions, receivers), m."""
    squares = np.zeros((len(sent), sent.shape[1], heard.shape[1]))
    for along in position.T:
        squares += (along[sent][:, :, None] - along[heard][:, None, :]) ** 2
    return np.asarray(np.sqrt(squares))


def _indices_in(listed: Ints, elements: int) -> Ints:
    """Index of each element in lists, (arrangements, elements); -1 where it is absent."""
    indices = np.full((len(listed), elements), -1, dtype=np.int64)
    np.put_along_axis(indices, listed, np.broadcast_to(np.arange(listed.shape[1]), listed.shape), axis=1)
    return indices


def _neighbours(position: Floats, listed: Ints) -> Ints:
    """The nearest other receiver of each element, (elements,)."""
    there = np.unique(listed)
    nearest = np.empty(len(position), dtype=np.int64)
    for start in range(0, len(position), 512):
        block = position[start : start + 512]
        apart = np.linalg.norm(block[:, None] - position[there], axis=-1)
        apart[apart == 0.0] = np.inf
        nearest[start : start + 512] = there[np.argmin(apart, axis=1)]
    return nearest


class _Measure(NamedTuple):
    """Sizes of residuals of arrangements, (arrangements, 4) or (arrangements,) each.

    Attributes:
        typical: of absolute times a quantile of the absolute residuals, of differences their mean.
        sigma: standard deviation of its logarithm.
        mean: mean absolute residual.
    """

    typical: Floats
    sigma: Floats
    mean: Floats


def _measure(values: Floats, most: float, *, median: bool, about: float | None = None) -> _Measure:
    """Sizes of residuals about their median or a number, cut off at ``most``; NaN with few."""
    flat = values.reshape(len(values), -1)
    counts = np.isfinite(flat).sum(axis=1)
    enough = counts >= MIN_PAIRS
    number = np.maximum(counts, 1)
    middle = np.maximum(counts - 1, 0)[:, None] // 2
    centre = np.take_along_axis(np.sort(flat, axis=1), middle, axis=1)
    size = np.abs(flat - (centre if about is None else about))
    cut = np.where(np.isfinite(size), np.minimum(size, most), 0.0)
    mean = cut.sum(axis=1) / number
    if median:
        rank = (PART * middle / 0.5).astype(np.int64)
        typical = np.take_along_axis(np.sort(size, axis=1), rank, axis=1)[:, 0]
        sigma = MEDIAN_SIGMA / np.sqrt(number)
    else:
        typical = mean
        sigma = np.sqrt((cut**2).sum(axis=1)) / np.maximum(mean * number, 1e-30)
    return _Measure(*(np.where(enough, sizes, np.nan) for sizes in (typical, sigma, mean)))

"""Emitters, receivers and data of one problem: a slice, a ring among rings, or the whole array."""

import math
from dataclasses import dataclass, replace

import numpy as np

from ..acquisition import Dataset
from ..acquisition.noise import robust_deviation
from ..arrays import Floats, Ints
from ..errors import InvalidInput
from .decomposition import decomposition_of, distinct_heights
from .directivity import within_opening
from .settings import Settings


@dataclass(frozen=True)
class Pairs:
    """Positions, m, and data of one problem.

    Attributes:
        emitters: (ntx, ndim).
        receivers: (rings, nrx, ndim).
        ring: (ntx,), index of the ring that receives an emitter.
        delta_tof: (ntx, nrx), s, object minus water; NaN where there is none.
        log_ratio: as ``delta_tof``, ln(A_water / A_object), Np; None where no amplitudes were recorded.
        noise_s: standard deviation of a time, s, from pairs measured both ways; 0: there are none.
    """

    emitters: Floats
    receivers: Floats
    ring: Ints
    delta_tof: Floats
    log_ratio: Floats | None = None
    noise_s: float = 0.0

    @property
    def elements(self) -> Floats:
        """Places of emitters and receivers, each once, (elements, ndim), m."""
        received = self.receivers.reshape(-1, self.receivers.shape[-1])
        return np.unique(np.concatenate((self.emitters, received)), axis=0)


def heights(dataset: Dataset) -> Floats | None:
    """Heights of the rings of an array, or of the slices of a scan, m, rising; None for a plain 2-D scan.

    Raises:
        InvalidInput: for an array in space that is moved along z as well.
    """
    if dataset.element_position_m.shape[1] == 2:
        return dataset.slice_z_m
    if dataset.slice_z_m is not None:
        raise InvalidInput(
            "slice/z_m", f"{dataset.slices} slices of an array in space", "slices of an array in a plane"
        )
    return distinct_heights(dataset.element_position_m)


def count(dataset: Dataset, settings: Settings) -> int:
    """Number of problems of the dataset.

    Raises:
        InvalidInput: as ``heights``, and for a volume with a single height.
    """
    z = heights(dataset)
    if decomposition_of(dataset.element_position_m, settings) == "slices":
        return 1 if z is None else len(z)
    if z is None or len(z) == 1:
        raise InvalidInput("decomposition", "'volume'", "slices, for the scan has one height only")
    return 1


def from_dataset(dataset: Dataset, settings: Settings, index: int) -> Pairs:
    """The pairs of one problem; ``index`` counts from 0.

    Raises:
        InvalidInput: for a problem without a travel time, as ``count``, and as ``within_opening``.
    """
    if not 0 <= index < count(dataset, settings):
        raise InvalidInput("slice", index, f"0 to {count(dataset, settings) - 1}")
    plane = dataset.element_position_m.shape[1] == 2
    if decomposition_of(dataset.element_position_m, settings) == "slices":
        pairs = _slice(dataset, settings, index) if plane else _ring(dataset, settings, index)
    elif plane:
        pairs = _moved_ring(dataset, settings)
    else:
        elements = np.arange(len(dataset.element_position_m))
        pairs = _between(dataset, settings, dataset.tx, dataset.rx, elements)
    if not np.isfinite(pairs.delta_tof).any():
        where = f" in slice {index}" if count(dataset, settings) > 1 else ""
        raise InvalidInput(
            "traveltime", f"no valid pair{where}", "at least one finite travel time between two elements"
        )
    return pairs


def _slice(dataset: Dataset, settings: Settings, index: int) -> Pairs:
    scan = dataset.slice(index)
    return _between(scan, settings, scan.tx, scan.rx, np.arange(len(scan.element_position_m)))


def _ring(dataset: Dataset, settings: Settings, index: int) -> Pairs:
    """One ring of a 3-D array, as a 2-D problem."""
    z = heights(dataset)
    height = dataset.element_position_m[:, 2]
    # Each ring begins at its lowest element; the highest one of an uneven ring may be far above it.
    ring = np.searchsorted(np.asarray(z), height, side="right") - 1
    whole = _between(dataset, settings, dataset.tx, dataset.rx, np.flatnonzero(ring == index))
    return replace(whole, emitters=whole.emitters[:, :2], receivers=whole.receivers[..., :2])


def _moved_ring(dataset: Dataset, settings: Settings) -> Pairs:
    """A ring at all its heights; each height receives only its own emitters."""
    z = np.asarray(heights(dataset))
    rings = [_slice(dataset, settings, k) for k in range(len(z))]

    def lifted(points: Floats, height: float) -> Floats:
        return np.column_stack((points, np.full(len(points), height)))

    ratios = [ring.log_ratio for ring in rings]
    finite = [ratio for ratio in ratios if ratio is not None]
    return Pairs(
        np.concatenate([lifted(ring.emitters, h) for ring, h in zip(rings, z, strict=True)]),
        np.stack([lifted(ring.receivers[0], h) for ring, h in zip(rings, z, strict=True)]),
        np.repeat(np.arange(len(z)), [len(ring.emitters) for ring in rings]),
        np.concatenate([ring.delta_tof for ring in rings]),
        np.concatenate(finite) if len(finite) == len(ratios) else None,
        max(ring.noise_s for ring in rings),
    )


def _between(dataset: Dataset, settings: Settings, tx: Ints, rx: Ints, members: Ints) -> Pairs:
    """The pairs between some elements, with reverse pairs if the settings use reciprocity."""
    data = [dataset.differential_tof()]
    if dataset.log_ratio_np is not None:
        usable = tx[:, None] != rx[None, :]
        usable = usable if dataset.valid is None else usable & dataset.valid
        data.append(np.where(usable, dataset.log_ratio_np, np.nan))
    if settings.opening_angle_deg is not None:
        inside = within_opening(dataset, settings.opening_angle_deg)
        data = [np.where(inside, values, np.nan) for values in data]
    if len(members) < len(dataset.element_position_m):
        sent, received = np.isin(tx, members), np.isin(rx, members)
        tx, rx = tx[sent], rx[received]
        data = [values[np.ix_(sent, received)] for values in data]
    emitters, receivers, noise = tx, rx, reciprocal_noise(tx, rx, data[0])
    if settings.numerics.reciprocity and tx.size and rx.size:
        # Travel times are reciprocal, so half of the matrix determines the other half, and every emitter then
        # has receivers on all sides of the object.
        emitters = receivers = np.union1d(tx, rx)
        squares = [_by_element(tx, rx, values)[1] for values in data]
        data = [np.where(np.isfinite(square), square, square.T) for square in squares]
    position, ring = dataset.element_position_m, np.zeros(len(emitters), np.int64)
    ratio = data[1] if len(data) > 1 else None
    return Pairs(position[emitters], position[receivers][None], ring, data[0], ratio, noise)


def reciprocal_noise(tx: Ints, rx: Ints, delta: Floats) -> float:
    """Standard deviation of a time, s, from the differences of pairs measured both ways; 0 without any.

    Both times of a pair are equal by reciprocity, so their difference has twice the variance of one.

    Args:
        tx, rx: elements of the rows and columns; delta: (ntx, nrx), s, NaN where there is none.
    """
    differences = reciprocal_differences(tx, rx, delta)
    return robust_deviation(differences) / math.sqrt(2.0) if differences.size else 0.0


def reciprocal_differences(tx: Ints, rx: Ints, delta: Floats) -> Floats:
    """Differences of the two times of each pair measured both ways, s; arguments as ``reciprocal_noise``."""
    elements, full = _by_element(tx, rx, delta)
    differences = (full - full.T)[np.triu_indices(len(elements), 1)]
    return np.asarray(differences[np.isfinite(differences)])


def _by_element(tx: Ints, rx: Ints, delta: Floats) -> tuple[Ints, Floats]:
    """All elements, and the data as a square matrix between them, NaN where there is none."""
    elements = np.union1d(tx, rx)
    full = np.full((len(elements), len(elements)), np.nan)
    # Duplicate entries of tx or rx keep their last value, as a dictionary would.
    full[np.searchsorted(elements, tx)[:, None], np.searchsorted(elements, rx)[None, :]] = delta
    return elements, full

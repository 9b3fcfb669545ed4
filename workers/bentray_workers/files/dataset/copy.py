"""Copying a dataset file to canonical form, or corrected, with traces in pieces: they may be too large."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import h5py

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.arrangement import rearranged
from bentray_kernels.acquisition.plausibility import ImplausibleUnit, WrongArrangement, check_plausible
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import FREQUENCY_HZ, SAMPLING_HZ

from ..hdf5_reading import opened, rejecting_hdf5_damage
from .read import NUMERIC, TRACES, dataset_of, kept_traces, placeholder_traces
from .units import POSITION_UNITS, TIME_UNITS
from .write import Piece, bytes_of, write_dataset

# Size of one piece; it takes about three times as much while it is read, converted and compressed.
PIECE_BYTES = 16 * 2**20
# Fields of Dataset that are times and lengths; the sampling rate is one over a time.
TIMES = ("tof_s", "delta_tof_s", "sigma_s", "t0_s")
LENGTHS = ("element_position_m", "slice_z_m", "radius_m")


def copy_dataset(
    source: Path,
    target: Path,
    on_size: Callable[[int], None] = lambda size: None,
    change: Callable[[Dataset], Dataset] | None = None,
) -> Dataset:
    """Check a dataset file and write it again, with one piece of its traces in memory at a time.

    Args:
        source: of the HDF5 file.
        target: replaced atomically.
        on_size: called before writing with the largest size of ``target`` without headers, bytes.
        change: returns the dataset to be written, with the same traces, and checks its units, which are not
            checked before.

    Returns:
        The dataset, with placeholders of the same shape and type for traces.

    Raises:
        InvalidInput: as ``read_dataset``, and for damaged traces.
        OSError: where the folder cannot be written to or the disk is full.
    """
    with opened(source) as reader:
        dataset = dataset_of(reader, placeholder_traces, plausible=change is None)
        if change is not None:
            dataset = change(dataset)
        on_size(bytes_of(dataset))

        def pieces(name: str, chunk: tuple[int, ...]) -> Iterator[Piece]:
            path = f"waveform/{name}"
            stored = reader.checked(path, NUMERIC, TRACES)
            assert stored is not None
            for where in blocks(stored, chunk):
                with rejecting_hdf5_damage(path, TRACES):
                    values = stored[where]
                yield where, kept_traces(values)

        write_dataset(target, dataset, pieces)
    return dataset


def blocks(stored: h5py.Dataset, chunk: tuple[int, ...]) -> Iterator[tuple[slice, ...]]:
    """Boxes of an array of about ``PIECE_BYTES``, aligned to its chunks.

    Args:
        stored: the array.
        chunk: of the target file; boxes are aligned to it too if they stay small.
    """
    shape, size = stored.shape, stored.dtype.itemsize
    own = stored.chunks or (1,) * len(shape)
    both = [math.lcm(a, b) for a, b in zip(own, chunk, strict=True)]
    unit = both if math.prod(both) * size <= PIECE_BYTES else own
    box = [min(side, n) for side, n in zip(unit, shape, strict=True)]
    for axis in reversed(range(len(shape))):
        box[axis] = min(shape[axis], box[axis] * max(1, PIECE_BYTES // (math.prod(box) * size)))
    starts = (range(0, n, side) for n, side in zip(shape, box, strict=True))
    for corner in itertools.product(*starts):
        yield tuple(slice(at, min(at + side, n)) for at, side, n in zip(corner, box, shape, strict=True))


@dataclass(frozen=True)
class Correction:
    """Corrected values of a scan; None: as it is stored.

    Attributes:
        times_in: unit of the times in the original file: travel times, deviations, time of the first sample,
            and sample interval.
        times_read_as: unit in which they were read; a file of the upload format is read in s.
        positions_in: unit of its lengths: positions, heights, radius, and the grid of the truth.
        positions_read_as: unit in which they were read.
        sampling_rate_hz, frequency_hz: of the traces, and centre frequency of the pulse, whatever is stored.
        arrangement: the fault in the order of the elements or in their positions, as the refusal of the scan
            names it, such as ``receivers-shifted-by-1``; see ``acquisition.arrangement``.

    Raises:
        InvalidInput: for unknown units, frequencies out of range, and a correction that changes nothing.
    """

    times_in: str | None = None
    times_read_as: str = "s"
    positions_in: str | None = None
    positions_read_as: str = "m"
    sampling_rate_hz: float | None = None
    frequency_hz: float | None = None
    arrangement: str | None = None

    def __post_init__(self) -> None:
        for what, units in (("times", TIME_UNITS), ("positions", POSITION_UNITS)):
            for name in (f"{what}_in", f"{what}_read_as"):
                unit = getattr(self, name)
                if unit is not None and unit not in units:
                    raise InvalidInput(name, repr(unit)[:40], f"one of {', '.join(units)}")
        for name, within in (("sampling_rate_hz", SAMPLING_HZ), ("frequency_hz", FREQUENCY_HZ)):
            value = getattr(self, name)
            if value is not None:
                within.check(name, value)
        if (
            self.time_factor == self.length_factor == 1.0
            and self.sampling_rate_hz is self.frequency_hz is None
            and self.arrangement is None
        ):
            shown = ", ".join(f"{name} {value}" for name, value in asdict(self).items() if value is not None)
            accepted = (
                "times_in or positions_in other than the unit read, sampling_rate_hz, frequency_hz or "
                "arrangement"
            )
            raise InvalidInput("correction", f"{shown}, which changes nothing", accepted)

    @property
    def time_factor(self) -> float:
        """True times over stored ones."""
        return _ratio(TIME_UNITS, self.times_in, self.times_read_as)

    @property
    def length_factor(self) -> float:
        """True lengths over stored ones."""
        return _ratio(POSITION_UNITS, self.positions_in, self.positions_read_as)

    def words(self) -> str:
        """The correction in words."""
        changes = []
        for what, factor, unit, read in (
            ("times", self.time_factor, self.times_in, self.times_read_as),
            ("lengths", self.length_factor, self.positions_in, self.positions_read_as),
        ):
            if factor != 1.0:
                changes.append(f"{what} in {unit}, read as {read} before (x {factor:g})")
        for what, value in (("sampling rate", self.sampling_rate_hz), ("frequency", self.frequency_hz)):
            if value is not None:
                changes.append(f"{what} {value:g} Hz")
        if self.arrangement is not None:
            changes.append(f"{self.arrangement.replace('-', ' ')} before")
        return ", ".join(changes)


def correct_dataset(
    source: Path,
    target: Path,
    correction: Correction,
    *,
    origin: str = "",
    on_size: Callable[[int], None] = lambda size: None,
) -> Dataset:
    """Write a corrected copy of a dataset file, with one piece of its traces in memory at a time.

    The copy passes the checks of ``read_dataset``, and states the correction in ``source``.

    Args:
        source: of the dataset file, which stays as it is.
        target: replaced atomically.
        correction: what was wrong.
        origin: name of the scan for the statement; empty: the name of the file.
        on_size: as for ``copy_dataset``.

    Returns:
        The corrected dataset, with placeholders for traces.

    Raises:
        InvalidInput: as ``copy_dataset``, and for values that are wrong or implausible after the correction.
        OSError: where the folder cannot be written to or the disk is full.
    """
    origin = origin or source.name

    def change(dataset: Dataset) -> Dataset:
        return corrected(dataset, correction, origin)

    return copy_dataset(source, target, on_size, change)


def corrected(dataset: Dataset, correction: Correction, origin: str) -> Dataset:
    """A dataset with its units, frequencies and elements corrected; see ``correct_dataset``."""
    if correction.arrangement is not None:
        dataset = rearranged(dataset, correction.arrangement)
    factor = correction.length_factor
    changes = _scaled(dataset, TIMES, correction.time_factor) | _scaled(dataset, LENGTHS, factor)
    if dataset.truth is not None:
        spacing_m, origin_m = (
            tuple(factor * length for length in lengths)
            for lengths in (dataset.truth.spacing_m, dataset.truth.origin_m)
        )
        changes["truth"] = replace(dataset.truth, spacing_m=spacing_m, origin_m=origin_m)
    if correction.sampling_rate_hz is not None:
        changes["sampling_rate_hz"] = correction.sampling_rate_hz
    elif dataset.sampling_rate_hz is not None:
        changes["sampling_rate_hz"] = dataset.sampling_rate_hz / correction.time_factor
    if correction.frequency_hz is not None:
        changes["center_frequency_hz"] = correction.frequency_hz
        # Amplitudes at the centre frequency, which was wrong.
        if dataset.amplitude_frequency_hz == dataset.center_frequency_hz is not None:
            changes["amplitude_frequency_hz"] = correction.frequency_hz
    statement = f"Corrected copy of {origin}: {correction.words()}"
    changes["source"] = f"{statement}. {dataset.source}" if dataset.source else statement
    try:
        made = replace(dataset, **changes)
        check_plausible(made)
        if _sampled(dataset) and not _sampled(made):
            raise InvalidInput(
                "sampling_rate_hz",
                f"{made.sampling_rate_hz or 0.0:g} Hz for pulses of {made.center_frequency_hz or 0.0:g} Hz",
                "more than twice the frequency; state sampling_rate_hz if it was right",
            )
    except InvalidInput as error:
        # A unit or an order that is proposed there is that of the corrected values.
        with_plain_words = ImplausibleUnit | WrongArrangement
        accepted = error.plain if isinstance(error, with_plain_words) else error.accepted
        raise InvalidInput(error.field, f"{error.value}, after the correction", accepted) from error
    return made


def _sampled(dataset: Dataset) -> bool:
    """Whether the sampling rate, if there is one, suffices for the centre frequency."""
    rate, frequency = dataset.sampling_rate_hz, dataset.center_frequency_hz
    return rate is None or frequency is None or rate > 2.0 * frequency


def _scaled(dataset: Dataset, names: tuple[str, ...], factor: float) -> dict[str, Any]:
    if factor == 1.0:
        return {}
    arrays = {name: getattr(dataset, name) for name in names}
    return {name: factor * value for name, value in arrays.items() if value is not None}


def _ratio(units: Mapping[str, float], true: str | None, read: str) -> float:
    # 1e-3 / 1e-6 is not 1000.
    return 1.0 if true is None else float(f"{units[true] / units[read]:.6g}")

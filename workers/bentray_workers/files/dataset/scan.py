"""Reading a scan: without its traces, its counts for plans, and its traces one emission at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.emissions import Emissions
from bentray_kernels.acquisition.pulse_spectrum import PulseSpectrum, estimate_spectrum
from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import check_size

from ..hdf5_reading import Reader, opened, rejecting_hdf5_damage
from .counts import BLOCK_BYTES, DatasetCounts, array_counts
from .read import NUMERIC, TRACES, dataset_of, kept_traces, trace_type, waveform_in


class ScanHeader(NamedTuple):
    """Facts about a scan without its traces.

    Attributes:
        dataset: without traces; a missing centre frequency is estimated from them.
        samples: of each trace of the object; 0 without traces.
        lacks_water: whether there are traces of the object, but no water shot.
        spectrum: of the pulse, where the frequency was estimated.
    """

    dataset: Dataset
    samples: int
    lacks_water: bool
    spectrum: PulseSpectrum | None


def read_header(path: Path, *, plausible: bool = True) -> ScanHeader:
    """Facts in a file about a scan, read at one opening.

    Args:
        path: of the HDF5 file.
        plausible: as ``read_dataset`` takes it.

    Raises:
        InvalidInput: as ``read_dataset``, and for traces without a pulse where the frequency is missing.
    """
    with opened(path) as reader:
        dataset, spectrum = dataset_of(reader, None, plausible=plausible), None
        if dataset.center_frequency_hz is None:
            spectrum = _spectrum(reader, stacked=dataset.slice_z_m is not None)
        samples, lacking = _samples(reader), _lacks_water(reader)
    if spectrum is not None:
        dataset = replace(dataset, center_frequency_hz=spectrum.center_frequency_hz)
    return ScanHeader(dataset, samples, lacking, spectrum)


def measured_spectrum(path: Path, dataset: Dataset) -> PulseSpectrum | None:
    """The spectrum of the pulse of a scan, from the first slice of its traces; None without traces.

    Args:
        path: of the HDF5 file.
        dataset: read from it.

    Raises:
        InvalidInput: for traces without a pulse.
    """
    with opened(path) as reader:
        return _spectrum(reader, stacked=dataset.slice_z_m is not None)


def trace_samples(path: Path) -> int:
    """Samples of each trace of a dataset file; 0 without traces of the object."""
    with opened(path) as reader:
        return _samples(reader)


def lacks_water(path: Path) -> bool:
    """Whether a dataset file has traces of the object, but no water shot."""
    with opened(path) as reader:
        return _lacks_water(reader)


def counts_in(path: Path) -> DatasetCounts:
    """Counts of a dataset file in canonical form, without reading the arrays over its pairs.

    Of a scan without a centre frequency, some emissions are read to estimate it.

    Args:
        path: of the HDF5 file.

    Raises:
        InvalidInput: for a file without positions, emitters or receivers, or with too many.
    """
    with opened(path) as reader:
        position, tx, rx = (
            _sized(reader, path)
            for path in ("geometry/element_position_m", "acquisition/tx", "acquisition/rx")
        )
        heights = _sized(reader, "slice/z_m") if reader.has("slice/z_m") else None
        received = reader.checked("waveform/object", NUMERIC, "traces")
        water = reader.number("water", "sound_speed_mps", "m/s")
        frequency = reader.number("acquisition", "center_frequency_hz", "Hz")
        if frequency is None:
            # Traces without a pulse are rejected when they are read, not when they are counted.
            with suppress(InvalidInput):
                spectrum = _spectrum(reader, stacked=heights is not None)
                frequency = None if spectrum is None else spectrum.center_frequency_hz
        return DatasetCounts(
            **array_counts(position, tx, rx, heights),
            times=any(_bytes(reader, f"traveltime/{name}") for name in ("delta_tof_s", "tof_s")),
            amplitudes=_bytes(reader, "amplitude/log_ratio_np") > 0,
            traces_bytes=sum(_bytes(reader, f"waveform/{name}") for name in ("object", "water")),
            samples=_samples(reader),
            sample_bytes=0 if received is None else trace_type(received.dtype).itemsize,
            rate_hz=reader.number("acquisition", "sampling_rate_hz", "Hz"),
            frequency_hz=frequency,
            # The speed hardly affects sizes.
            water_mps=1500.0 if water is None else water,
            water_shot=_bytes(reader, "waveform/water") > 0,
            normals=reader.has("geometry/element_normal"),
        )


@contextmanager
def open_slice(
    path: Path, whole: Dataset, index: int, poll: Callable[[], None] = lambda: None
) -> Iterator[Dataset]:
    """One slice with its traces as ``Emissions``, which are read on access while the context is open.

    Args:
        path: of the HDF5 file.
        whole: the dataset, read without its traces.
        index: of the slice, from 0.
        poll: called at each access to an emission; may raise.

    Raises:
        InvalidInput: as ``read_dataset``; on access for damaged traces.
    """
    with opened(path) as reader:
        stored = None if whole.slice_z_m is None else index
        read = partial(emissions_in, reader, poll=poll, index=stored)
        yield replace(whole.slice(index), waveform=waveform_in(reader, read, stored))


def emissions_in(
    reader: Reader, path: str, *, poll: Callable[[], None] = lambda: None, index: int | None
) -> Emissions | None:
    """The traces of a path, of one slice unless ``index`` is None, to be read while the file is open."""
    stored = reader.checked(path, NUMERIC, TRACES)
    if stored is None:
        return None
    chunks = stored.chunks or (1,) * stored.ndim
    block = max(1, min(chunks[-3], BLOCK_BYTES // (math.prod(stored.shape[-2:]) * stored.dtype.itemsize)))

    # Emissions in the same chunks are decompressed together, since they are accessed in order.
    @lru_cache(maxsize=1)
    def rows(number: int) -> NDArray[Any]:
        selected = slice(number * block, (number + 1) * block)
        with rejecting_hdf5_damage(path, TRACES):
            traces = stored[selected] if index is None else stored[index, selected]
        return kept_traces(traces)

    def emission(e: int) -> NDArray[Any]:
        poll()
        traces: NDArray[Any] = rows(e // block)[e % block]
        return traces

    dtype = trace_type(stored.dtype)
    return Emissions.from_reader(emission, stored.shape[-3:], dtype)


def _spectrum(reader: Reader, *, stacked: bool) -> PulseSpectrum | None:
    """Like ``measured_spectrum`` for an open file, whose arrays may have an axis of slices."""
    rate = reader.number("acquisition", "sampling_rate_hz", "Hz")
    traces = emissions_in(reader, "waveform/object", index=0 if stacked else None)
    return None if traces is None or rate is None else estimate_spectrum(traces, rate)


def _lacks_water(reader: Reader) -> bool:
    stored = [reader.checked(f"waveform/{name}", NUMERIC, TRACES) for name in ("object", "water")]
    return stored[0] is not None and stored[1] is None


def _samples(reader: Reader) -> int:
    received = reader.checked("waveform/object", NUMERIC, TRACES)
    return 0 if received is None else int(received.shape[-1])


def _sized(reader: Reader, path: str) -> NDArray[Any]:
    """An array, whose size is checked before it is read."""
    declared = reader.checked(path, NUMERIC, "numbers")
    check_size(path, () if declared is None else declared.shape)
    return reader.required(path, NUMERIC, "numbers")


def _bytes(reader: Reader, path: str) -> int:
    stored = reader.checked(path, NUMERIC, "numbers")
    return 0 if stored is None else math.prod(stored.shape) * stored.dtype.itemsize

"""Reading a scan: without its traces, its counts for plans, and its traces one emission at a time."""

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

from ..hdf5_reading import Reader, opened, rejecting_hdf5_damage
from .counts import BLOCK_BYTES, DatasetCounts
from .read import NUMERIC, TRACES, dataset_of, kept_traces, placeholder_traces, trace_type, waveform_in


class ScanHeader(NamedTuple):
    """Facts about a scan without its traces.

    Attributes:
        dataset: without traces; a missing centre frequency may be estimated from them.
        samples: of each trace of the object; 0 without traces.
        lacks_water: whether there are traces of the object, but no water shot.
        spectrum: of the pulse, where the frequency was estimated.
    """

    dataset: Dataset
    samples: int
    lacks_water: bool
    spectrum: PulseSpectrum | None


def read_header(path: Path, *, plausible: bool = True, estimate: bool = True) -> ScanHeader:
    """Facts in a file about a scan, read at one opening.

    Args:
        path: of the HDF5 file.
        plausible: as ``read_dataset`` takes it.
        estimate: whether to estimate a missing centre frequency, which reads traces.

    Raises:
        InvalidInput: as ``read_dataset``, and for traces without a pulse where the frequency is missing.
    """
    with opened(path) as reader:
        dataset, spectrum = dataset_of(reader, None, plausible=plausible), None
        if estimate and dataset.center_frequency_hz is None:
            spectrum = _spectrum(reader, stacked=dataset.slice_z_m is not None)
        received, water = (
            reader.checked(f"waveform/{name}", NUMERIC, TRACES) for name in ("object", "water")
        )
        samples = 0 if received is None else int(received.shape[-1])
        lacking = received is not None and water is None
    if spectrum is not None:
        dataset = replace(dataset, center_frequency_hz=spectrum.center_frequency_hz)
    return ScanHeader(dataset, samples, lacking, spectrum)


def measured_frequency(path: Path) -> float | None:
    """Centre frequency of the traces, Hz, from their first slice; None without traces or a pulse in them."""
    # Traces without a pulse are a finding of the quality report.
    with opened(path) as reader, suppress(InvalidInput):
        spectrum = _spectrum(reader, stacked=reader.has("slice/z_m"))
        return None if spectrum is None else spectrum.center_frequency_hz
    return None


def counts_in(path: Path) -> DatasetCounts:
    """Counts of a dataset file; a missing centre frequency is that of its traces.

    Args:
        path: of the HDF5 file.

    Raises:
        InvalidInput: as ``read_dataset``, but for units and an order that are only implausible.
    """
    with opened(path) as reader:
        counts = DatasetCounts.from_dataset(dataset_of(reader, placeholder_traces, plausible=False))
    return counts if counts.frequency_hz else replace(counts, frequency_hz=measured_frequency(path))


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
    """The spectrum of the pulse, from the first slice of the traces; None without traces.

    Raises:
        InvalidInput: for traces without a pulse.
    """
    rate = reader.number("acquisition", "sampling_rate_hz", "Hz")
    traces = emissions_in(reader, "waveform/object", index=0 if stacked else None)
    return None if traces is None or rate is None else estimate_spectrum(traces, rate)

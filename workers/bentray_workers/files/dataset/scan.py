"""Reading a scan without its traces, with a centre frequency estimated from them where it has none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.pulse_spectrum import PulseSpectrum, estimate_spectrum

from ..hdf5_reading import Limits, Reader, opened
from .read import dataset_of
from .traces import emissions_in, lacks_water_in, samples_in


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
    with opened(path, Limits()) as reader:
        dataset, spectrum = dataset_of(reader, None, plausible=plausible), None
        if dataset.center_frequency_hz is None:
            spectrum = spectrum_in(reader, stacked=dataset.slice_z_m is not None)
        samples, lacking = samples_in(reader), lacks_water_in(reader)
    if spectrum is not None:
        dataset = replace(dataset, center_frequency_hz=spectrum.center_frequency_hz)
    return ScanHeader(dataset, samples, lacking, spectrum)


def read_scan(path: Path) -> Dataset:
    """The dataset of ``read_header``."""
    return read_header(path).dataset


def spectrum_of(path: Path, dataset: Dataset) -> PulseSpectrum | None:
    """The spectrum of the pulse of a scan without a centre frequency, from the first slice of its traces.

    Args:
        path: of the HDF5 file.
        dataset: read from it.

    Returns:
        None for a scan with a centre frequency or without traces.

    Raises:
        InvalidInput: for traces without a pulse.
    """
    if dataset.center_frequency_hz is not None:
        return None
    return measured_spectrum(path, dataset)


def measured_spectrum(path: Path, dataset: Dataset) -> PulseSpectrum | None:
    """Like ``spectrum_of``, also for a scan with a centre frequency."""
    with opened(path, Limits()) as reader:
        return spectrum_in(reader, stacked=dataset.slice_z_m is not None)


def spectrum_in(reader: Reader, *, stacked: bool) -> PulseSpectrum | None:
    """The spectrum of the pulse of an open file, from the first slice of its traces; None without traces.

    Args:
        reader: of the file.
        stacked: whether its arrays have an axis of slices.

    Raises:
        InvalidInput: for traces without a pulse.
    """
    rate = reader.number("acquisition", "sampling_rate_hz", "Hz")
    traces = emissions_in(reader, "waveform/object", index=0 if stacked else None)
    return None if traces is None or rate is None else estimate_spectrum(traces, rate)

"""The traces of one slice of a dataset file, and how many samples they have."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Waveform

from .dataset_reading import NUMERIC, TRACES, dataset_of
from .hdf5_reading import Limits, Reader, opened


def trace_samples(path: Path) -> int:
    """Samples of each trace of a dataset file; 0 where there are none of the object or none of the water."""
    with opened(path, Limits()) as reader:
        return samples_in(reader)


def samples_in(reader: Reader) -> int:
    """As ``trace_samples`` of an open file."""
    found = [reader.checked(f"waveform/{name}", NUMERIC, TRACES) for name in ("object", "water")]
    return 0 if None in found or found[0] is None else int(found[0].shape[-1])


def read_slice(path: Path, index: int) -> Dataset:
    """One slice of a dataset that has been read before, with the traces of that slice alone.

    Args:
        path: of the HDF5 file.
        index: of the slice, from 0.

    Raises:
        InvalidInput: as ``read_dataset``.
    """
    with opened(path, Limits()) as reader:
        whole = dataset_of(reader, None)
        received, water = (_traces(reader, f"waveform/{name}", whole, index) for name in ("object", "water"))
        factors = [
            reader.array(f"waveform/{name}", NUMERIC, "numbers over (ntx, nrx)")
            for name in ("object_scale", "water_scale")
        ]
        scale = reader.number("waveform", "scale", "the unit of the traces a count")
    one = whole.slice(index)
    if received is None:
        return one
    of_slice = [
        None
        if factor is None
        else np.asarray(factor if whole.slice_z_m is None else factor[index], np.float64)
        for factor in factors
    ]
    return replace(one, waveform=Waveform(received, water, 1.0 if scale is None else scale, *of_slice))


def _traces(reader: Reader, path: str, whole: Dataset, index: int) -> NDArray[Any] | None:
    stored = reader.checked(path, NUMERIC, TRACES)
    if stored is None:
        return None
    found = stored[()] if whole.slice_z_m is None else stored[index]
    return np.ascontiguousarray(found, np.float32 if found.dtype.kind == "f" else np.int16)

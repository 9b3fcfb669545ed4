"""Reading the traces of one slice of a dataset file, one emission at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.emissions import Emissions

from ..hdf5_reading import Limits, Reader, opened, rejecting_hdf5_damage
from .counts import BLOCK_BYTES
from .read import NUMERIC, TRACES, kept_traces, trace_type, waveform_in


def trace_samples(path: Path) -> int:
    """Samples of each trace of a dataset file; 0 without traces of the object."""
    with opened(path, Limits()) as reader:
        return samples_in(reader)


def lacks_water(path: Path) -> bool:
    """Whether a dataset file has traces of the object, but no water shot."""
    with opened(path, Limits()) as reader:
        return lacks_water_in(reader)


def lacks_water_in(reader: Reader) -> bool:
    """Like ``lacks_water`` for an open file."""
    stored = [reader.checked(f"waveform/{name}", NUMERIC, TRACES) for name in ("object", "water")]
    return stored[0] is not None and stored[1] is None


def samples_in(reader: Reader) -> int:
    """Like ``trace_samples`` for an open file."""
    received = reader.checked("waveform/object", NUMERIC, TRACES)
    return 0 if received is None else int(received.shape[-1])


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
    with opened(path, Limits()) as reader:
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

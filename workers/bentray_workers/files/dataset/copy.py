"""Copying a dataset file to canonical form, with traces in pieces, since they may exceed the memory."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py

from bentray_kernels.acquisition import Dataset

from ..hdf5_reading import opened, rejecting_hdf5_damage
from .read import NUMERIC, TRACES, dataset_of, kept_traces, placeholder_traces
from .write import Piece, bytes_of, write_dataset

# Size of one piece; it takes about three times as much while it is read, converted and compressed.
PIECE_BYTES = 16 * 2**20


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

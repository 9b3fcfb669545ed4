"""Plain arrays of HDF5 files by name, as of MATLAB 7.3."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..files.bounded_reading import check_row
from ..files.dataset.counts import BLOCK_BYTES
from ..files.hdf5_reading import Reader, rejecting_hdf5_damage

NUMBERS = "a plain array of real numbers"


class Matlab73:
    """The arrays of one file; see ``Arrays``. MATLAB stores them with reversed axes.

    Args:
        reader: of the file.
        is_matlab: whether the file has the header of MATLAB.
    """

    reversed_axes = True

    def __init__(self, reader: Reader, *, is_matlab: bool = True) -> None:
        self._reader = reader
        self.kind = "a MATLAB 7.3 file" if is_matlab else "an HDF5 file"

    def names(self) -> tuple[str, ...]:
        return self._reader.names()

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        stored = self._reader.checked(name, "iuf", NUMBERS) if self._reader.contains(name) else None
        if stored is None:
            return None
        # MATLAB marks empty arrays and stores their shape as numbers.
        if self._reader.attribute(name, "MATLAB_empty") is not None:
            raise InvalidInput(name, "an empty array", NUMBERS)
        return stored.shape, stored.dtype

    def whole(self, name: str) -> NDArray[Any]:
        return self._reader.required(name, "iuf", NUMBERS)

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        stored = self._reader.checked(name, "iuf", NUMBERS)
        if stored is None:
            raise InvalidInput(name, "nothing", NUMBERS)
        check_row(name, stored.shape, stored.dtype)
        yield from rows_of(stored, name)


def rows_of(stored: h5py.Dataset, name: str, before: tuple[int, ...] = ()) -> Iterator[NDArray[Any]]:
    """The rows of an array along one axis, in blocks, so that a chunk is decompressed once or few times.

    Args:
        stored: checked array, whose rows fit into the memory.
        name: for errors.
        before: indices of the axes before that of the rows.
    """
    axis = len(before)
    count = stored.shape[axis]
    row_bytes = max(1, stored.dtype.itemsize * int(np.prod(stored.shape[axis + 1 :], dtype=np.int64)))
    chunk = 1 if stored.chunks is None else stored.chunks[axis]
    block = max(1, min(chunk, BLOCK_BYTES // row_bytes))
    for begin in range(0, count, block):
        with rejecting_hdf5_damage(name, NUMBERS):
            rows = np.asarray(stored[(*before, slice(begin, begin + block))])
        yield from rows

"""MATLAB files of version 7.3, which are HDF5: plain arrays of numbers by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..files.hdf5_reading import Reader, rejecting_damage
from .arrays import check_row

NUMBERS = "a plain array of real numbers"


class Matlab73:
    """The arrays of one file; see ``Arrays``. HDF5 stores them with reversed axes."""

    kind = "a MATLAB 7.3 file"
    reversed_axes = True

    def __init__(self, reader: Reader) -> None:
        self._reader = reader

    def names(self) -> tuple[str, ...]:
        return self._reader.names()

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        stored = self._reader.checked(name, "iuf", NUMBERS)
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
        for k in range(stored.shape[0]):
            with rejecting_damage(name, NUMBERS):
                row = np.asarray(stored[k])
            yield row

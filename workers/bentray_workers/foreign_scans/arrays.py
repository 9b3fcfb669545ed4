"""What every foreign file gives: arrays of numbers by name, whole where small, row by row where large."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.limits import COUNTED, OVER_PAIRS, check_size

# Of an array that is read whole, and of one row of an array that is read in rows.
LARGEST_WHOLE = 256 * 2**20
LARGEST_ROW = 256 * 2**20

# Of all the arrays of a file, as it declares them.
LARGEST_TOTAL = 32 * 2**30

MOST_AXES = 4

# What stands where in the upload format, by names without their groups and by those of others.
PLACES = {place.rpartition("/")[2]: place for place in (*COUNTED, *OVER_PAIRS)} | {
    "element_positions": "geometry/element_position_m",
    "delta_tof": "traveltime/delta_tof_s",
}


class Arrays(Protocol):
    """The arrays of one open file, all in C order; those of MATLAB with their axes reversed, as stored.

    Attributes:
        kind: of file, in words.
        reversed_axes: whether axes are those of the user's program in reverse.
    """

    kind: str
    reversed_axes: bool

    def names(self) -> tuple[str, ...]:
        """Names of the variables, readable or not."""

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        """Shape and type of an array of numbers, which has been checked; None where it is absent.

        Raises:
            InvalidInput: naming it, for anything that is no plain array of numbers.
        """

    def whole(self, name: str) -> NDArray[Any]:
        """An array that ``declared`` knows."""

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        """Its parts along the first axis, one after the other."""


def small(arrays: Arrays, name: str, accepted: str) -> NDArray[Any] | None:
    """An array as its user wrote it, axes in the user's order; None where it is absent.

    Raises:
        InvalidInput: naming it, where it is not numbers, or larger than any scan's.
    """
    found = arrays.declared(name)
    if found is None:
        return None
    shape, dtype = found
    check_size(PLACES.get(name, name), shape[::-1] if arrays.reversed_axes else shape, name)
    size = math.prod(shape) * dtype.itemsize
    if size > LARGEST_WHOLE:
        raise InvalidInput(name, f"shape {shape}, {size} bytes", accepted)
    array = arrays.whole(name)
    return array.T if arrays.reversed_axes else array


def check_declared(
    name: str, shape: Sequence[int], dtype: np.dtype[Any], stored: int, packing: float
) -> None:
    """Refuse what cannot be read: other than numbers, of many axes, larger than is stored.

    Args:
        name: of the array.
        shape, dtype: as declared.
        stored: bytes that are there for it, packed.
        packing: how many times that they may unpack to.

    Raises:
        InvalidInput: naming it.
    """
    if dtype.kind not in "iufb" or dtype.itemsize > 8:
        raise InvalidInput(name, f"{dtype}", "real numbers of at most 8 bytes, or booleans")
    if len(shape) > MOST_AXES or any(n < 0 for n in shape):
        raise InvalidInput(name, f"shape {tuple(shape)}", f"at most {MOST_AXES} axes")
    size = math.prod(int(n) for n in shape) * dtype.itemsize
    if size > LARGEST_TOTAL:
        raise InvalidInput(name, f"{size} bytes unpacked", f"at most {LARGEST_TOTAL} bytes")
    if size > packing * stored + 4096:
        raise InvalidInput(name, f"{size} bytes, of which {stored} are stored", "data that are in the file")


def check_row(name: str, shape: Sequence[int], dtype: np.dtype[Any]) -> None:
    """Refuse rows that are too large to hold one of.

    Raises:
        InvalidInput: naming the array.
    """
    size = math.prod(shape[1:]) * dtype.itemsize
    if size > LARGEST_ROW:
        raise InvalidInput(name, f"{size} bytes in an emission", f"at most {LARGEST_ROW} bytes")

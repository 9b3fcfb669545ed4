"""Arrays of foreign files by name: small ones read whole, large ones by rows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput
from bentray_kernels.limits import COUNTED, OVER_PAIRS, check_size

from ..files.complex_numbers import check_real

# Of an array that is read whole, and of one row of an array that is read by rows.
LARGEST_WHOLE = 256 * 2**20
LARGEST_ROW = 256 * 2**20

# Of all declared arrays of a file.
LARGEST_TOTAL = 32 * 2**30

MAX_AXES = 4

# Fields of the upload format by names without groups, and by foreign names.
PLACES = {path.rpartition("/")[2]: path for path in (*COUNTED, *OVER_PAIRS)} | {
    "element_positions": "geometry/element_position_m",
    "delta_tof": "traveltime/delta_tof_s",
}


class Arrays(Protocol):
    """The arrays of one open file in C order; those of MATLAB have reversed axes, as stored.

    Attributes:
        kind: of file, in words.
        reversed_axes: whether axes are reversed relative to the program of the user.
    """

    kind: str
    reversed_axes: bool

    def names(self) -> tuple[str, ...]:
        """Names of the variables, readable or not."""

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        """Checked shape and type of an array of numbers; None if it is absent.

        Raises:
            InvalidInput: naming it, for anything but a plain array of numbers.
        """

    def whole(self, name: str) -> NDArray[Any]:
        """Read an array that is present."""

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        """Its rows along the first axis, one after the other."""


def read_small(arrays: Arrays, name: str, accepted: str) -> NDArray[Any] | None:
    """An array with axes in the order of the user; None if it is absent.

    Raises:
        InvalidInput: naming it, for other content than numbers, or too large an array.
    """
    declaration = arrays.declared(name)
    if declaration is None:
        return None
    shape, dtype = declaration
    check_size(PLACES.get(name, name), shape[::-1] if arrays.reversed_axes else shape, name)
    size = math.prod(shape) * dtype.itemsize
    if size > LARGEST_WHOLE:
        raise InvalidInput(name, f"shape {shape}, {size} bytes", accepted)
    array = arrays.whole(name)
    return array.T if arrays.reversed_axes else array


def check_declared(
    name: str, shape: Sequence[int], dtype: np.dtype[Any], stored: int, packing: float
) -> None:
    """Reject arrays of other types, with many axes, or larger than their stored data.

    Args:
        name: of the array.
        shape, dtype: as declared.
        stored: size of the stored data, compressed, bytes.
        packing: largest compression ratio.

    Raises:
        InvalidInput: naming it.
    """
    check_real(name, dtype, "real numbers")
    if dtype.kind not in "iufb" or dtype.itemsize > 8:
        raise InvalidInput(name, f"{dtype}", "real numbers of at most 8 bytes, or booleans")
    if len(shape) > MAX_AXES or any(n < 0 for n in shape):
        raise InvalidInput(name, f"shape {tuple(shape)}", f"at most {MAX_AXES} axes")
    size = math.prod(int(n) for n in shape) * dtype.itemsize
    if size > LARGEST_TOTAL:
        raise InvalidInput(name, f"{size} bytes unpacked", f"at most {LARGEST_TOTAL} bytes")
    if size > packing * stored + 4096:
        raise InvalidInput(name, f"{size} bytes, of which {stored} are stored", "data that are in the file")


def check_row(name: str, shape: Sequence[int], dtype: np.dtype[Any]) -> None:
    """Reject rows that are too large for the memory.

    Raises:
        InvalidInput: naming the array.
    """
    size = math.prod(shape[1:]) * dtype.itemsize
    if size > LARGEST_ROW:
        raise InvalidInput(name, f"{size} bytes in an emission", f"at most {LARGEST_ROW} bytes")

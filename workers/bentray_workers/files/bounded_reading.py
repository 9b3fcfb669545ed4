"""Bounded reading of foreign arrays: declared sizes are checked first, and no more is read."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bentray_kernels.errors import InvalidInput

from .damage import check_real
from .volume import check_shape, check_type

# Declared values of one volume, uncompressed.
LARGEST_BYTES = 2 * 2**30
# Of one row of an array that is read by rows; of all declared arrays of a file; of axes.
LARGEST_ROW = 256 * 2**20
LARGEST_TOTAL = 32 * 2**30
MAX_AXES = 4

# Padding after the values of a compressed file: some writers align its end.
LONGEST_TAIL = 2**16

# Units of length in headers.
UNITS_M = {"m": 1.0, "meter": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "micron": 1e-6}


# Raises InvalidInput for a shape that the caller cannot use.
ShapeCheck = Callable[[Sequence[int]], None]


def any_shape(shape: Sequence[int]) -> None:
    """Accepts every shape."""


def declared(
    field: str, shape: Sequence[int], dtype: np.dtype[Any], check: ShapeCheck = any_shape, least: int = 2
) -> int:
    """Check shape and type; returns the size of the values, bytes."""
    check_type(field, dtype)
    check_shape(field, shape, least)
    check(shape)
    count = math.prod(int(n) for n in shape) * dtype.itemsize
    if count > LARGEST_BYTES:
        raise InvalidInput(field, f"shape {tuple(shape)}, {count} bytes", f"at most {LARGEST_BYTES} bytes")
    return count


def whole(file: Any, count: int) -> bytes:
    """Read exactly so many bytes, also of a compressed file with more."""
    data: bytes = file.read(count)
    if len(data) < count:
        raise InvalidInput("file", f"{len(data)} bytes of values", f"{count}, as its header says")
    return data


def at_end(file: Any, tail: int = 0) -> None:
    """Check that an uncompressed file ends here; its reader then verifies check sum and length.

    Args:
        file: with all values read.
        tail: bytes that may follow.

    Raises:
        InvalidInput: for more data. The reader itself raises for a wrong check sum.
    """
    if len(file.read(tail + 1)) > tail:
        excess = "more data after the values than its header declares"
        raise InvalidInput("file", excess, "the values and nothing more")


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

"""Bounded reading of foreign volumes: declared sizes are checked first, and no more is read."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bentray_kernels.errors import InvalidInput

from .volume import check_shape, check_type

# Declared values of one volume, uncompressed.
LARGEST_BYTES = 2 * 2**30
# Header before the values of a file.
LONGEST_HEADER = 2**20

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

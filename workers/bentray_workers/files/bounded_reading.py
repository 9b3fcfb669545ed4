"""Reading foreign volumes: what a file declares is checked first, and no more than that is read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from bentray_kernels.errors import InvalidInput

from .volume import check_shape, check_type

# Of the values of one volume, as the file declares them, unpacked.
LARGEST_BYTES = 2 * 2**30
# Before the values of a file; longer ones are no honest headers.
LONGEST_HEADER = 2**20

# After the values, of a file that is packed: some writers align its end, none adds much.
LONGEST_TAIL = 2**16

# Units of length in headers.
UNITS_M = {"m": 1.0, "meter": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "micron": 1e-6}


# Raises InvalidInput for a shape that the one who asks for the volume has no use for.
ShapeCheck = Callable[[Sequence[int]], None]


def any_shape(shape: Sequence[int]) -> None:
    """The shape check of those who can use every volume."""


def declared(field: str, shape: Sequence[int], dtype: np.dtype[Any], check: ShapeCheck = any_shape) -> int:
    """Bytes of the values, once shape and type are ones that are taken."""
    check_type(field, dtype)
    check_shape(field, shape)
    check(shape)
    count = math.prod(int(n) for n in shape) * dtype.itemsize
    if count > LARGEST_BYTES:
        raise InvalidInput(field, f"shape {tuple(shape)}, {count} bytes", f"at most {LARGEST_BYTES} bytes")
    return count


def whole(file: Any, count: int) -> bytes:
    """So many bytes and no more, however many a packed file would give."""
    data: bytes = file.read(count)
    if len(data) < count:
        raise InvalidInput("file", f"{len(data)} bytes of values", f"{count}, as its header says")
    return data


def at_end(file: Any, tail: int = 0) -> None:
    """See that an unpacked file ends here, which makes its reader verify the check sum and the length.

    Args:
        file: all of whose values have been read.
        tail: bytes that may follow.

    Raises:
        InvalidInput: where more follows. The reader itself raises where the check sum is another.
    """
    if len(file.read(tail + 1)) > tail:
        found = "more data after the values than its header declares"
        raise InvalidInput("file", found, "the values and nothing more")


@contextmanager
def rejecting_damage(field: str, accepted: str) -> Iterator[None]:
    """Turn what readers raise on damage into InvalidInput for this field."""
    try:
        yield
    except (InvalidInput, MemoryError):
        raise
    except Exception as error:
        # Foreign readers raise anything at all on a damaged header: a tokenizer's errors, a unit's, a bit's.
        reason = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise InvalidInput(field, f"damaged data ({reason[:120]})", accepted) from None

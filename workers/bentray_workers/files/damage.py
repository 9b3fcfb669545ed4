"""What readers refuse in files of any format: damaged data, as InvalidInput, and complex numbers."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from bentray_kernels.errors import InvalidInput


@contextmanager
def rejecting_damage(
    field: str, accepted: str, errors: tuple[type[Exception], ...] = (Exception,), given: str = ""
) -> Iterator[None]:
    """Convert these exceptions of readers on damaged data to InvalidInput for this field.

    By default all but MemoryError: readers raise exceptions of any type on a damaged header. The message says
    ``given`` of the data; empty: the text of the exception.
    """
    try:
        yield
    except InvalidInput:
        raise
    except errors as error:
        if isinstance(error, MemoryError) and MemoryError not in errors:
            raise
        reason = next(iter(str(error).splitlines()), "") or type(error).__name__
        raise InvalidInput(field, given or f"damaged data ({reason[:120]})", accepted) from None


def first_bytes(data: bytes) -> str:
    """The beginning of a file of another kind in words, for a message."""
    return f"it begins with {repr(data[:8])[1:]}"


# Names of the parts in HDF5: of h5py, of MATLAB 7.3, and of other writers.
PARTS = (("r", "i"), ("real", "imag"), ("re", "im"), ("real", "imaginary"))
ACCEPTED = "of complex traces the real part; of IQ data the real part after modulation to the carrier"


def check_real(field: str, dtype: np.dtype[Any], accepted: str) -> None:
    """Raise InvalidInput for a complex type, also for one that is stored as a pair of parts."""
    names = tuple(name.lower() for name in dtype.names or ())
    if dtype.kind == "c" or names in PARTS:
        shown = f"complex{8 * dtype.itemsize}"
        raise InvalidInput(field, f"complex numbers ({shown})", f"{accepted}; {ACCEPTED}")

"""MATLAB files (.mat, version 5) of named arrays."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..atomic import atomic_replace

# Of one array: the limit of this version of the format.
LARGEST_BYTES = 2**31 - 1
# SciPy writes the time there; a fixed header gives the same bytes for the same arrays.
ABOUT = b"MATLAB 5.0 MAT-file, written by Bentray".ljust(116)


def write_mat(path: Path, arrays: Mapping[str, NDArray[Any] | str]) -> None:
    """Write arrays and texts by name; ``path`` is replaced atomically.

    Lists become rows; the axes of an array keep their order.

    Raises:
        InvalidInput: for an array of more than ``LARGEST_BYTES``.
        OSError: where the folder cannot be written to or the disk is full.
    """
    from scipy.io import savemat

    for name, array in arrays.items():
        size = np.asarray(array).nbytes
        if size > LARGEST_BYTES:
            accepted = f"at most {LARGEST_BYTES} bytes for MATLAB; hdf5 holds any, and MATLAB reads it"
            raise InvalidInput("volume", f"{name} of {size} bytes", accepted)
    with atomic_replace(path) as partial, partial.open("wb") as file:
        savemat(file, dict(arrays), oned_as="row")
        file.seek(0)
        file.write(ABOUT)

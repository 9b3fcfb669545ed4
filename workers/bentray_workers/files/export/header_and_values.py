"""One file with a text header and raw values after it, as MetaImage and NRRD have."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..atomic import atomic_replace


def write_header_and_values(path: Path, header: str, values: NDArray[Any]) -> None:
    """Write the header, then little-endian values with x varying fastest; ``path`` is replaced atomically.

    Args:
        path: of the file.
        header: text up to the first value.
        values: (nx, ny[, nz]).

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    stored = np.asarray(values, dtype=values.dtype.newbyteorder("<"))
    with atomic_replace(path) as partial, partial.open("wb") as file:
        file.write(header.encode())
        # One slice at a time, since transposing the whole would double the memory.
        for k in range(stored.shape[-1]):
            file.write(stored[..., k].tobytes(order="F"))


def type_name(values: NDArray[Any], names: Mapping[str, str]) -> str:
    """Name of the type of the values in a format, by its NumPy code without byte order, e.g. ``f4``."""
    return names[values.dtype.str[1:]]

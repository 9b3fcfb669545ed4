"""MATLAB files (.mat, version 5) of named arrays."""

from pathlib import Path

import numpy as np

from bentray_kernels.errors import InvalidInput

from ..atomic import atomic_replace
from .content import Content

# Of one array: the limit of this version of the format.
LARGEST_BYTES = 2**31 - 1
# SciPy writes the time there; a fixed header gives the same bytes for the same arrays.
ABOUT = b"MATLAB 5.0 MAT-file, written by Bentray".ljust(116)


def write(path: Path, content: Content) -> None:
    """Write all images, the grid and the title by name; see ``ExportFormat.write``.

    Lists become rows; the axes of an array keep their order. An array has at most ``LARGEST_BYTES``.
    """
    from scipy.io import savemat

    grid = content.grid
    arrays = {**content.images, "spacing_m": np.array(grid.spacing_m), "origin_m": np.array(grid.origin_m)}
    if content.values.ndim == 3:
        arrays["direction"] = grid.direction
    for name, array in arrays.items():
        size = array.nbytes
        if size > LARGEST_BYTES:
            accepted = f"at most {LARGEST_BYTES} bytes for MATLAB; hdf5 holds any, and MATLAB reads it"
            raise InvalidInput("volume", f"{name} of {size} bytes", accepted)
    with atomic_replace(path) as partial, partial.open("wb") as file:
        texts = {"axes": ",".join("xyz"[: content.values.ndim]), "title": content.title}
        savemat(file, arrays | texts, oned_as="row")
        file.seek(0)
        file.write(ABOUT)

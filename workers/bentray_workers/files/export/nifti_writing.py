"""Writing volumes as NIfTI files: lengths in mm, positions in RAS."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..atomic import atomic_replace
from ..bounded_reading import UNITS_M
from ..volume_axes import Grid
from .even_spacing import check_even_spacing

# Largest number of nodes along an axis in the header of NIfTI-1.
MAX_NODES = 2**15 - 1
# Code for coordinates of the scanner.
SCANNER = 1


def write_nifti(
    path: Path,
    values: NDArray[Any],
    grid: Grid,
    title: str,
) -> None:
    """Write a volume as NIfTI-1, or as NIfTI-2 where an axis is too long; ``path`` is replaced atomically.

    Args:
        path: of the file; compressed with gzip if its name ends in ``.gz``.
        values: (nx, ny[, nz]), of a type of NIfTI.
        grid: positions of the nodes.
        title: for the description, truncated.

    Raises:
        InvalidInput: for uneven spacing, which NIfTI cannot store.
        OSError: where the folder cannot be written to or the disk is full.
    """
    from nibabel.nifti1 import Nifti1Image
    from nibabel.nifti2 import Nifti2Image

    check_even_spacing(grid.spacing_m, "NIfTI")
    affine = grid.affine(UNITS_M["mm"])
    kind = Nifti1Image if max(values.shape) <= MAX_NODES else Nifti2Image
    image = kind(values, affine)
    image.set_sform(affine, SCANNER)
    image.set_qform(affine, SCANNER)
    image.header.set_xyzt_units("mm")
    length = image.header["descrip"].dtype.itemsize
    image.header["descrip"] = title.encode()[:length].decode(errors="ignore").encode()
    with atomic_replace(path) as partial, partial.open("wb") as file:
        if path.name.lower().endswith(".gz"):
            # Without name and time: the same volume gives the same bytes.
            with gzip.GzipFile("", "wb", fileobj=file, mtime=0) as packed:
                image.to_stream(packed)
        else:
            image.to_stream(file)

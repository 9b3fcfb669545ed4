"""NIfTI files of volumes: lengths in mm, axes to the right, front and up."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from .atomic import replacing
from .bounded_reading import UNITS_M

# Nodes along an axis that the header of NIfTI-1 can tell.
MOST_NODES = 2**15 - 1
# Of nibabel's codes: places are those of the scanner.
SCANNER = 1


def write_nifti(
    path: Path,
    values: NDArray[Any],
    spacing_m: Sequence[float],
    origin_m: Sequence[float],
    title: str,
) -> None:
    """Write a volume as NIfTI-1, or as NIfTI-2 where an axis is too long; ``path`` is replaced whole.

    Args:
        path: the file to make.
        values: (nx, ny[, nz]), of a type that NIfTI has.
        spacing_m: between nodes, one an axis, m.
        origin_m: place of node 0, one an axis, m.
        title: as much of it as fits becomes the description.

    Raises:
        InvalidInput: for spacing that is not even, which NIfTI cannot tell.
        OSError: where the folder cannot be written to or the disk is full.
    """
    from nibabel.nifti1 import Nifti1Image
    from nibabel.nifti2 import Nifti2Image

    if not np.isfinite(spacing_m).all():
        found = f"uneven slices (spacing {tuple(float(step) for step in spacing_m)} m)"
        raise InvalidInput("volume", found, "even spacing for NIfTI; hdf5 holds any")
    affine, ndim = np.eye(4), values.ndim
    affine[range(ndim), range(ndim)] = np.divide(spacing_m, UNITS_M["mm"])
    affine[:ndim, 3] = np.divide(origin_m, UNITS_M["mm"])
    kind = Nifti1Image if max(values.shape) <= MOST_NODES else Nifti2Image
    image = kind(values, affine)
    image.set_sform(affine, SCANNER)
    image.set_qform(affine, SCANNER)
    image.header.set_xyzt_units("mm")
    room = image.header["descrip"].dtype.itemsize
    image.header["descrip"] = title.encode()[:room].decode(errors="ignore").encode()
    with replacing(path) as partial, partial.open("wb") as file:
        image.to_stream(file)

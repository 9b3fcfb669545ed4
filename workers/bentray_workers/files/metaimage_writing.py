"""MetaImage files (.mha) of volumes: a few lines of text, then the values; lengths in mm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from .atomic import replacing
from .bounded_reading import UNITS_M

# Names of the types that volumes have.
ELEMENTS = {"u1": "MET_UCHAR", "u2": "MET_USHORT", "f4": "MET_FLOAT", "f8": "MET_DOUBLE"}


def write_metaimage(
    path: Path,
    values: NDArray[Any],
    spacing_m: Sequence[float],
    origin_m: Sequence[float],
    title: str,
) -> None:
    """Write a volume as MetaImage, header and values in one file; ``path`` is replaced whole.

    Places are those of our axes, without a claim of how they lie in the body: ITK, which gives them to the
    left, back and up, shows the numbers as they are here.

    Args:
        path: the file to make.
        values: (nx, ny[, nz]), of a type of ``ELEMENTS``.
        spacing_m: between nodes, one an axis, m.
        origin_m: place of node 0, one an axis, m.
        title: becomes the comment.

    Raises:
        InvalidInput: for spacing that is not even, which MetaImage cannot tell.
        OSError: where the folder cannot be written to or the disk is full.

    Source:
        The tags and their order are those of the MetaIO documentation of ITK.
    """
    if not np.isfinite(spacing_m).all():
        found = f"uneven slices (spacing {tuple(float(step) for step in spacing_m)} m)"
        raise InvalidInput("volume", found, "even spacing for MetaImage; hdf5 holds any")
    ndim = values.ndim
    stored = np.asarray(values, dtype=values.dtype.newbyteorder("<"))
    tags = {
        "ObjectType": "Image",
        "NDims": ndim,
        "Comment": " ".join(title.split()),
        "BinaryData": True,
        "BinaryDataByteOrderMSB": False,
        "CompressedData": False,
        "TransformMatrix": _row(np.eye(ndim, dtype=int).ravel()),
        "Offset": _row(np.divide(origin_m, UNITS_M["mm"])),
        "CenterOfRotation": _row(np.zeros(ndim, int)),
        "ElementSpacing": _row(np.divide(spacing_m, UNITS_M["mm"])),
        "DimSize": _row(values.shape),
        "ElementType": ELEMENTS[stored.dtype.str[1:]],
        # What follows this line are the values.
        "ElementDataFile": "LOCAL",
    }
    if not tags["Comment"]:
        del tags["Comment"]
    header = "".join(f"{name} = {value}\n" for name, value in tags.items())
    with replacing(path) as partial, partial.open("wb") as file:
        file.write(header.encode())
        # x runs fastest; a slice at a time, since turning the whole would need as much memory again.
        for k in range(stored.shape[-1]):
            file.write(stored[..., k].tobytes(order="F"))


def _row(values: Any) -> str:
    return " ".join(str(value) for value in np.asarray(values).tolist())

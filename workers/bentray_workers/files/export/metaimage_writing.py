"""Writing volumes as MetaImage files (.mha): a text header, then the values; positions in mm, LPS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..bounded_reading import UNITS_M
from ..volume_axes import LPS, Grid
from .even_spacing import check_even_spacing
from .header_and_values import type_name, write_header_and_values

# Names of the types of volumes.
ELEMENTS = {"u1": "MET_UCHAR", "u2": "MET_USHORT", "f4": "MET_FLOAT", "f8": "MET_DOUBLE"}


def write_metaimage(
    path: Path,
    values: NDArray[Any],
    grid: Grid,
    title: str,
) -> None:
    """Write a volume as MetaImage, header and values in one file; ``path`` is replaced atomically.

    Args:
        path: of the file.
        values: (nx, ny[, nz]), of a type of ``ELEMENTS``.
        grid: positions of the nodes.
        title: for the comment.

    Raises:
        InvalidInput: for uneven spacing, which MetaImage cannot store.
        OSError: where the folder cannot be written to or the disk is full.

    Source:
        The tags and their order are those of the MetaIO documentation of ITK.
    """
    check_even_spacing(grid.spacing_m, "MetaImage")
    ndim = values.ndim
    origin = (LPS @ grid.affine(UNITS_M["mm"]))[:ndim, 3]
    directions = (LPS[:3, :3] @ grid.direction)[:ndim, :ndim]
    tags = {
        "ObjectType": "Image",
        "NDims": ndim,
        "Comment": " ".join(title.split()),
        "BinaryData": True,
        "BinaryDataByteOrderMSB": False,
        "CompressedData": False,
        "TransformMatrix": _row(directions.T.ravel()),
        "Offset": _row(origin),
        "CenterOfRotation": _row(np.zeros(ndim, int)),
        "ElementSpacing": _row(np.divide(grid.spacing_m, UNITS_M["mm"])),
        "DimSize": _row(values.shape),
        "ElementType": type_name(values, ELEMENTS),
        # The values follow this line.
        "ElementDataFile": "LOCAL",
    }
    if not tags["Comment"]:
        del tags["Comment"]
    header = "".join(f"{name} = {value}\n" for name, value in tags.items())
    write_header_and_values(path, header, values)


def _row(values: Any) -> str:
    # Adding 0 makes −0 the same as 0.
    return " ".join(str(value + 0) for value in np.asarray(values).tolist())

"""Writing volumes as MetaImage files (.mha): a text header, then the values; positions in mm, LPS."""

from pathlib import Path
from typing import Any

import numpy as np

from ..bounded_reading import UNITS_M
from ..volume_axes import LPS
from .content import Content, type_name, write_header_and_values

# Names of the types of volumes.
ELEMENTS = {"u1": "MET_UCHAR", "u2": "MET_USHORT", "f4": "MET_FLOAT", "f8": "MET_DOUBLE"}


def write(path: Path, content: Content) -> None:
    """Write values of a type of ``ELEMENTS`` as MetaImage, in one file; see ``ExportFormat.write``.

    Source:
        The tags and their order are those of the MetaIO documentation of ITK.
    """
    values, grid = content.values, content.grid
    ndim = values.ndim
    origin = (LPS @ grid.affine(UNITS_M["mm"]))[:ndim, 3]
    directions = (LPS[:3, :3] @ grid.direction)[:ndim, :ndim]
    tags = {
        "ObjectType": "Image",
        "NDims": ndim,
        "Comment": content.line,
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

"""Writing volumes as VTK ImageData (.vti) for ParaView: XML with all images as appended raw data."""

import struct
from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import quoteattr

from ..atomic import atomic_replace
from .content import Content, write_values

TYPES = {"u1": "UInt8", "u2": "UInt16", "f4": "Float32", "f8": "Float64"}
SIZE = struct.Struct("<Q")


def write(path: Path, content: Content) -> None:
    """Write images of a type of ``TYPES`` as point data; see ``ExportFormat.write``.

    Positions are in m, RAS: VTK has no unit and no body. The selected image is shown first.

    Source:
        "VTK XML Formats" of the VTK documentation: ``ImageData``, appended data, encoding raw.
    """
    images, grid = content.images, content.grid
    active = next(name for name, image in images.items() if image is content.values)
    shape = (*next(iter(images.values())).shape, 1)[:3]
    extent = " ".join(f"0 {n - 1}" for n in shape)
    # A plane has one layer; its thickness is not shown.
    spacing, origin = (*grid.spacing_m, grid.spacing_m[0])[:3], grid.affine()[:3, 3]
    arrays, offset = [], 0
    for name, image in images.items():
        kind = TYPES[image.dtype.newbyteorder("<").str[1:]]
        arrays.append(
            f'<DataArray type="{kind}" Name={quoteattr(name)} format="appended" offset="{offset}"/>'
        )
        offset += SIZE.size + image.nbytes
    header = (
        '<?xml version="1.0"?>\n'
        '<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f'<ImageData WholeExtent="{extent}" Origin="{_row(origin)}" Spacing="{_row(spacing)}" '
        f'Direction="{_row(grid.direction.ravel())}">\n'
        f'<Piece Extent="{extent}"><PointData Scalars={quoteattr(active)}>\n'
        + "\n".join(arrays)
        + '\n</PointData></Piece></ImageData>\n<AppendedData encoding="raw">_'
    )
    with atomic_replace(path) as partial, partial.open("wb") as file:
        file.write(header.encode())
        for image in images.values():
            file.write(SIZE.pack(image.nbytes))
            write_values(file, image)
        file.write(b"</AppendedData>\n</VTKFile>\n")


def _row(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)

"""Writing volumes as NRRD files: lengths in mm, positions in RAS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..bounded_reading import UNITS_M
from ..volume_axes import Grid
from .even_spacing import check_even_spacing
from .header_and_values import type_name, write_header_and_values

TYPES = {"u1": "uint8", "u2": "uint16", "f4": "float", "f8": "double"}


def write_nrrd(
    path: Path,
    values: NDArray[Any],
    grid: Grid,
    title: str,
) -> None:
    """Write a volume as NRRD 4, header and raw values in one file; ``path`` is replaced atomically.

    A plane becomes a volume of one slice, since NRRD has no names for the spaces of planes.

    Args:
        path: of the file.
        values: (nx, ny[, nz]), of a type of ``TYPES``.
        grid: positions of the nodes.
        title: for the content.

    Raises:
        InvalidInput: for uneven spacing, which NRRD cannot store.
        OSError: where the folder cannot be written to or the disk is full.

    Source:
        "Definition of NRRD File Format", teem.sourceforge.net/nrrd/format.html. The values are written by
        slices, which pynrrd cannot do.
    """
    check_even_spacing(grid.spacing_m, "NRRD")
    values = values[..., None] if values.ndim == 2 else values
    affine = grid.affine(UNITS_M["mm"])
    fields = {
        "content": " ".join(title.split()),
        "type": type_name(values, TYPES),
        "dimension": 3,
        "space": "right-anterior-superior",
        "sizes": " ".join(map(str, values.shape)),
        "space directions": " ".join(_vector(step) for step in affine[:3, :3].T),
        "space units": " ".join(['"mm"'] * 3),
        "space origin": _vector(affine[:3, 3]),
        "endian": "little",
        "encoding": "raw",
    }
    if not fields["content"]:
        del fields["content"]
    header = "NRRD0004\n" + "".join(f"{name}: {value}\n" for name, value in fields.items()) + "\n"
    write_header_and_values(path, header, values)


def _vector(values: NDArray[Any]) -> str:
    return "(" + ",".join(repr(float(value)) for value in values) + ")"

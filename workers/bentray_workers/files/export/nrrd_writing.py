"""Writing volumes as NRRD files: lengths in mm, positions in RAS."""

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..bounded_reading import UNITS_M
from .content import Content, type_name, write_header_and_values

TYPES = {"u1": "uint8", "u2": "uint16", "f4": "float", "f8": "double"}


def write(path: Path, content: Content) -> None:
    """Write values of a type of ``TYPES`` as NRRD 4, in one file; see ``ExportFormat.write``.

    A plane becomes a volume of one slice, since NRRD has no names for the spaces of planes.

    Source:
        "Definition of NRRD File Format", teem.sourceforge.net/nrrd/format.html. The values are written by
        slices, which pynrrd cannot do.
    """
    values = content.values[..., None] if content.values.ndim == 2 else content.values
    affine = content.grid.affine(UNITS_M["mm"])
    fields = {
        "content": content.line,
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

"""Writing volumes as NRRD files: lengths in mm, without an orientation in the body."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..bounded_reading import UNITS_M
from .even_spacing import check_even_spacing
from .header_and_values import type_name, write_header_and_values

TYPES = {"u1": "uint8", "u2": "uint16", "f4": "float", "f8": "double"}


def write_nrrd(
    path: Path,
    values: NDArray[Any],
    spacing_m: Sequence[float],
    origin_m: Sequence[float],
    title: str,
) -> None:
    """Write a volume as NRRD 4, header and raw values in one file; ``path`` is replaced atomically.

    Args:
        path: of the file.
        values: (nx, ny[, nz]), of a type of ``TYPES``.
        spacing_m: per axis, m.
        origin_m: position of node 0, per axis, m.
        title: for the content.

    Raises:
        InvalidInput: for uneven spacing, which NRRD cannot store.
        OSError: where the folder cannot be written to or the disk is full.

    Source:
        "Definition of NRRD File Format", teem.sourceforge.net/nrrd/format.html. The values are written by
        slices, which pynrrd cannot do.
    """
    check_even_spacing(spacing_m, "NRRD")
    ndim = values.ndim
    steps = np.diag(np.divide(spacing_m, UNITS_M["mm"]))
    fields = {
        "content": " ".join(title.split()),
        "type": type_name(values, TYPES),
        "dimension": ndim,
        "space dimension": ndim,
        "sizes": " ".join(map(str, values.shape)),
        "space directions": " ".join(_vector(row) for row in steps),
        "space units": " ".join(['"mm"'] * ndim),
        "space origin": _vector(np.divide(origin_m, UNITS_M["mm"])),
        "endian": "little",
        "encoding": "raw",
    }
    if not fields["content"]:
        del fields["content"]
    header = "NRRD0004\n" + "".join(f"{name}: {value}\n" for name, value in fields.items()) + "\n"
    write_header_and_values(path, header, values)


def _vector(values: NDArray[Any]) -> str:
    return "(" + ",".join(repr(float(value)) for value in values) + ")"

"""Reading NRRD: the header by pynrrd, the values here, since pynrrd decompresses without bound."""

from __future__ import annotations

import gzip
from collections.abc import Sequence
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Floats
from bentray_kernels.errors import InvalidInput

from .bounded_reading import LONGEST_HEADER, UNITS_M, ShapeCheck, any_shape, at_end, declared, whole
from .damage import rejecting_damage
from .volume import Volume
from .volume_axes import reorient

NRRD_TYPES = {
    "i1": ("signed char", "int8", "int8_t"),
    "u1": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "i2": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "u2": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "i4": ("int", "signed int", "int32", "int32_t"),
    "u4": ("uint", "unsigned int", "uint32", "uint32_t"),
    "i8": ("longlong", "long long", "signed long long", "int64", "int64_t"),
    "u8": ("ulonglong", "unsigned long long", "uint64", "uint64_t"),
    "f4": ("float",),
    "f8": ("double",),
}


# Header fields of values stored elsewhere.
ELSEWHERE = ("data file", "datafile", "byte skip", "byteskip", "line skip", "lineskip")


def read_nrrd(file: IO[bytes], check: ShapeCheck = any_shape) -> Volume:
    """The volume in an NRRD file with attached values; raises InvalidInput for other files.

    Its axes go to the right, front and head if the space of the file is anatomical, as ``LPS``; otherwise
    they are in the order and direction of that space.

    ``check`` is called with the shape before the values are read.
    """
    import nrrd

    start = file.read(LONGEST_HEADER)
    # The header ends with an empty line.
    ends = [start.find(mark) + len(mark) for mark in (b"\n\n", b"\r\n\r\n") if mark in start]
    if not ends:
        raise InvalidInput("file", "an NRRD header without an end", f"one of at most {LONGEST_HEADER} bytes")
    accepted = "a whole NRRD file in three dimensions"
    with rejecting_damage("file", accepted):
        header: Any = nrrd.read_header(start[: min(ends)].splitlines(keepends=True))
        # A detached data file could be any file of this machine; its name is not repeated.
        for field in ELSEWHERE:
            if field in header:
                raise InvalidInput(field, "values elsewhere", "values in the same file, after the header")
        kinds = set(header.get("kinds", ())) - {"domain", "space", "none", "???"}
        if kinds:
            raise InvalidInput("kinds", ", ".join(sorted(kinds)), "domain or space along each axis")
        dtype = next((np.dtype(code) for code, names in NRRD_TYPES.items() if header["type"] in names), None)
        if dtype is None:
            raise InvalidInput("type", repr(header["type"]), "a type of numbers")
        dtype = dtype.newbyteorder(">" if header.get("endian") == "big" else "<")
        shape = tuple(int(n) for n in header["sizes"])
        count = declared("sizes", shape, dtype, check)
        if header["dimension"] != len(shape):
            raise InvalidInput("dimension", header["dimension"], f"{len(shape)}, as many as there are sizes")
        file.seek(min(ends))
        encoding = header["encoding"]
        if encoding == "raw":
            data = whole(file, count)
            at_end(file)
        elif encoding in ("gzip", "gz"):
            with gzip.open(file) as unpacked:
                data = whole(unpacked, count)
                at_end(unpacked)
        else:
            raise InvalidInput("encoding", repr(encoding), "raw or gzip")
        values = np.frombuffer(data, dtype).reshape(shape, order="F")
        values, affine = reorient(values, _affine(header), "space directions")
        with np.errstate(over="ignore"):
            steps = np.linalg.norm(affine[:3, :3], axis=0)
        return Volume.of(values, steps.tolist(), affine[:3, 3].tolist(), str(header.get("content", "")))


def _affine(header: Any) -> Floats:
    """(4, 4) from nodes to positions in the space of the file, m."""
    # Spacings are in units of the axes, directions and origin in those of the space.
    own, space = header.get("units"), header.get("space units")
    around = _metres(space or own)
    affine = np.eye(4)
    directions = header.get("space directions")
    if directions is None:
        spacings = header.get("spacings", [1.0] * 3)
        if len(spacings) != 3 or not all(0.0 < step < np.inf for step in spacings):
            raise InvalidInput(
                "spacings", [float(step) for step in spacings], "three finite distances above 0"
            )
        affine[:3, :3] = np.diag(np.multiply(spacings, _metres(own or space)))
    else:
        affine[:3, :3] = (directions * around).T
    affine[:3, 3] = np.multiply(header.get("space origin", [0.0] * 3), around)
    return np.diag([*_axis_signs(header.get("space")), 1.0]) @ affine


def _axis_signs(space: Any) -> tuple[float, float, float]:
    """Signs of the axes of a space relative to right, front and head.

    Spaces without anatomical directions, as ``3D-right-handed``, are unchanged.
    """
    words = str(space or "").lower().removesuffix("-time")
    words = {"ras": "right-anterior-superior", "las": "left-anterior-superior"}.get(words, words)
    words = {"lps": "left-posterior-superior"}.get(words, words)
    left, back = words.startswith("left-"), "-posterior-" in words
    return -1.0 if left else 1.0, -1.0 if back else 1.0, 1.0


def _metres(names: Sequence[str] | None) -> NDArray[np.float64]:
    """Units of the three axes, m; mm by default."""
    units = [str(name).strip('" ') or "mm" for name in names or ["mm"] * 3]
    for unit in units:
        if unit not in UNITS_M:
            raise InvalidInput("units", repr(unit), "one of " + ", ".join(UNITS_M))
    if len(units) != 3:
        raise InvalidInput("units", ", ".join(units), "three, one for each axis")
    return np.array([UNITS_M[unit] for unit in units])

"""NRRD: pynrrd reads the header, the values are read here, since pynrrd unpacks without bound."""

from __future__ import annotations

import gzip
from typing import IO, Any

import numpy as np

from bentray_kernels.errors import InvalidInput

from .bounded_reading import LONGEST_HEADER, UNITS_M, declared, refusing, whole
from .volume_file import Volume

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


def read_nrrd(file: IO[bytes]) -> Volume:
    """The volume in an NRRD file with its values after the header; raises InvalidInput for anything else."""
    import nrrd

    start = file.read(LONGEST_HEADER)
    # The header ends with an empty line.
    ends = [start.find(mark) + len(mark) for mark in (b"\n\n", b"\r\n\r\n") if mark in start]
    if not ends:
        raise InvalidInput("file", "an NRRD header without an end", f"one of at most {LONGEST_HEADER} bytes")
    accepted = "a whole NRRD file in three dimensions"
    with refusing("file", accepted):
        header: Any = nrrd.read_header(start[: min(ends)].splitlines(keepends=True))
        # A data file beside the header could be any file of this machine.
        for field in ("data file", "datafile", "byte skip", "byteskip", "line skip", "lineskip"):
            if header.get(field):
                raise InvalidInput(
                    field, repr(header[field])[:80], "values in the same file, after the header"
                )
        kinds = set(header.get("kinds", ())) - {"domain", "space", "none", "???"}
        if kinds:
            raise InvalidInput("kinds", ", ".join(sorted(kinds)), "domain or space along each axis")
        dtype = next((np.dtype(code) for code, names in NRRD_TYPES.items() if header["type"] in names), None)
        if dtype is None:
            raise InvalidInput("type", repr(header["type"]), "a type of numbers")
        dtype = dtype.newbyteorder(">" if header.get("endian") == "big" else "<")
        shape = tuple(int(n) for n in header["sizes"])
        count = declared("sizes", shape, dtype)
        file.seek(min(ends))
        encoding = header["encoding"]
        if encoding == "raw":
            data = whole(file, count)
        elif encoding in ("gzip", "gz"):
            with gzip.open(file) as unpacked:
                data = whole(unpacked, count)
        else:
            raise InvalidInput("encoding", repr(encoding), "raw or gzip")
        values = np.frombuffer(data, dtype).reshape(shape, order="F")
        return Volume.of(values, *_nrrd_grid(header), str(header.get("content", "")))


def _nrrd_grid(header: Any) -> tuple[list[float], list[float]]:
    """Spacing and origin, m."""
    named = header.get("space units") or header.get("units") or ["mm"]
    unit = str(named[0]).strip('" ') or "mm"
    if unit not in UNITS_M:
        raise InvalidInput("units", repr(unit), "one of " + ", ".join(UNITS_M))
    directions = header.get("space directions")
    steps = header.get("spacings", [1.0] * 3) if directions is None else np.linalg.norm(directions, axis=1)
    origin = header.get("space origin", [0.0] * 3)
    return [float(s) * UNITS_M[unit] for s in steps], [float(x) * UNITS_M[unit] for x in origin]

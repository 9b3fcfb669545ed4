"""Volumes in NumPy archives: the one 3-D array of a zip of .npy files; nothing is unpickled."""

from __future__ import annotations

import zipfile
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from .bounded_reading import LONGEST_HEADER, ShapeCheck, at_end, declared, whole
from .damage import rejecting_damage
from .npy_headers import PARSING

START = b"PK\x03\x04"
SUFFIX = ".npy"
MAX_MEMBERS = 100
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
# Flag of a member with a password.
SECRET = 1

WHOLE = "a whole .npz of plain arrays, one of them with three dimensions"


def read_npz(file: IO[bytes], check: ShapeCheck) -> NDArray[Any]:
    """The 3-D array of an archive; other arrays, as of a spacing, are not read.

    Args:
        file: open, at its start.
        check: of the shape, called before the values are read.

    Raises:
        InvalidInput: from ``check``; for no or several 3-D arrays, values that are not real numbers, more
            than ``LARGEST_BYTES``, and a damaged archive.
    """
    with rejecting_damage("file", WHOLE), zipfile.ZipFile(file) as archive:
        members = [member for member in archive.infolist() if member.filename.endswith(SUFFIX)]
        if len(members) > MAX_MEMBERS:
            raise InvalidInput("file", f"{len(members)} arrays", f"at most {MAX_MEMBERS}")
        for number, member in enumerate(members):
            if member.compress_type not in PACKINGS or member.flag_bits & SECRET:
                raise InvalidInput("file", f"array {number} with a password or another packing", WHOLE)
        shapes = {member: _header(archive, member)[0] for member in members}
        volumes = [member for member, shape in shapes.items() if len(shape) == 3]
        if len(volumes) != 1:
            listed = ", ".join(str(shape) for shape in shapes.values())[:200]
            words = f"{len(volumes)} arrays with three dimensions (shapes {listed or 'none'})"
            raise InvalidInput("file", words, WHOLE)
        return _values(archive, volumes[0], check)


def _header(
    archive: zipfile.ZipFile, member: zipfile.ZipInfo
) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Shape, whether columns come first, type, and the bytes of the header."""
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        with PARSING:
            read = (
                np.lib.format.read_array_header_1_0
                if version == (1, 0)
                else np.lib.format.read_array_header_2_0
            )
            shape, columns_first, dtype = read(stream, max_header_size=LONGEST_HEADER)
        return tuple(int(n) for n in shape), bool(columns_first), dtype, stream.tell()


def _values(archive: zipfile.ZipFile, member: zipfile.ZipInfo, check: ShapeCheck) -> NDArray[Any]:
    shape, columns_first, dtype, start = _header(archive, member)
    count = declared("values", shape, dtype, check)
    with archive.open(member) as stream:
        whole(stream, start)
        values = np.frombuffer(whole(stream, count), dtype)
        at_end(stream)
    return values.reshape(shape[::-1]).T if columns_first else values.reshape(shape)

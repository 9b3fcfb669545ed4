"""MATLAB files of version 5 (6, 7): plain arrays of numbers, decompressed only as far as they are read.

The format is that of "MAT-File Format", The MathWorks, chapter 1. Cells, structures, objects, functions and
opaque data are never read.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..files.complex_numbers import ACCEPTED
from .arrays import check_declared, check_row
from .stream import Stream

START = b"MATLAB 5.0 MAT-file"
HEADER_BYTES = 128

MATRIX, COMPRESSED = 14, 15

# Types of data in the file, by number.
STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
# Classes of numeric arrays, by number, and of other arrays.
NUMBERS = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
OTHERS = {
    1: "a cell",
    2: "a structure",
    3: "an object",
    4: "text",
    5: "a sparse matrix",
    16: "a function",
    17: "opaque",
}
COMPLEX, COMPLEX_NUMBERS = 0x0800, "complex numbers"

MAX_VARIABLES = 1000
LONGEST_NAME = 200
# Alignment after the numbers of an array.
PADDING_BYTES = 8
# Largest compression ratio of zlib is 1032.
PACKING = 1100.0


@dataclass(frozen=True)
class _Variable:
    """Position of the numbers of an array.

    Attributes:
        offset: of the content of its element in the file.
        stored: size of the content, bytes.
        packed: whether it is compressed.
        begin: of the numbers in the decompressed content.
        found: shape in the order of the user, type of the array, and stored type; or its kind in words.
    """

    offset: int
    stored: int
    packed: bool
    begin: int
    found: tuple[tuple[int, ...], np.dtype[Any], np.dtype[Any]] | str


class Matlab5:
    """The arrays of one file; see ``Arrays``. Axes are reversed, as stored.

    Raises:
        InvalidInput: for a damaged file.
    """

    kind = "a MATLAB 5 file"
    reversed_axes = True

    def __init__(self, path: Path) -> None:
        self._path = path
        with path.open("rb") as file:
            header = file.read(HEADER_BYTES)
            if len(header) < HEADER_BYTES or header[126:128] not in (b"IM", b"MI"):
                raise InvalidInput("file", "a damaged header of MATLAB 5", "a whole MATLAB file")
            self._order = "<" if header[126:128] == b"IM" else ">"
            self._variables = dict(self._index(file, path.stat().st_size))

    def names(self) -> tuple[str, ...]:
        return tuple(self._variables)

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        variable = self._variables.get(name)
        if variable is None:
            return None
        if isinstance(variable.found, str):
            accepted = "a plain array of real numbers"
            if variable.found == COMPLEX_NUMBERS:
                accepted = f"{accepted}; {ACCEPTED}"
            raise InvalidInput(name, variable.found, accepted)
        shape, dtype, stored = variable.found
        reversed_shape = shape[::-1]
        packing = PACKING if variable.packed else 1.0
        check_declared(name, reversed_shape, stored, variable.stored, packing)
        check_declared(name, reversed_shape, dtype, variable.stored, 8 * packing)
        return reversed_shape, dtype

    def whole(self, name: str) -> NDArray[Any]:
        shape, _ = self._known(name)
        (array,) = self._parts(name, 1, math.prod(shape))
        return array.reshape(shape)

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        shape, dtype = self._known(name)
        check_row(name, shape, dtype)
        for part in self._parts(name, shape[0], math.prod(shape[1:])):
            yield part.reshape(shape[1:])

    def _known(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        declaration = self.declared(name)
        if declaration is None:
            raise InvalidInput(name, "nothing", "an array")
        return declaration

    def _parts(self, name: str, count: int, size: int) -> Iterator[NDArray[Any]]:
        """Read parts of equal size, one after the other."""
        variable = self._variables[name]
        assert not isinstance(variable.found, str)
        _, dtype, stored = variable.found
        with self._path.open("rb") as file:
            stream = Stream(file, variable.offset, variable.stored, variable.packed, name)
            stream.skip(variable.begin)
            for _ in range(count):
                data = stream.read(size * stored.itemsize)
                # A damaged NaN may signal, which is no reason to warn.
                with np.errstate(invalid="ignore"):
                    part = np.frombuffer(data, dtype=stored).astype(dtype)
                yield part
            stream.end(PADDING_BYTES)

    def _index(self, file: IO[bytes], size: int) -> Iterator[tuple[str, _Variable]]:
        at = HEADER_BYTES
        for _ in range(MAX_VARIABLES):
            if at + 8 > size:
                return
            file.seek(at)
            kind, length = struct.unpack(self._order + "II", file.read(8))
            if kind not in (MATRIX, COMPRESSED) or at + 8 + length > size:
                raise InvalidInput("file", f"a damaged element at byte {at}", "a whole MATLAB file")
            packed = kind == COMPRESSED
            yield self._variable(Stream(file, at + 8, length, packed, "file"), at + 8, length, packed)
            at += 8 + length
        raise InvalidInput("file", f"more than {MAX_VARIABLES} variables", "fewer")

    def _variable(self, stream: Stream, offset: int, length: int, packed: bool) -> tuple[str, _Variable]:
        if packed:
            kind, _ = struct.unpack(self._order + "II", stream.read(8))
            if kind != MATRIX:
                raise InvalidInput("file", f"an element of type {kind}", "a whole MATLAB file")
        flags = self._small(stream, 8)
        if len(flags) != 8:
            raise InvalidInput("file", "a damaged array", "a whole MATLAB file")
        (word,) = struct.unpack(self._order + "I", flags[:4])
        number = word & 0xFF
        if number == 17:
            # Opaque ones have no dimensions; their name comes at once.
            name = self._small(stream, LONGEST_NAME).decode("ascii", "replace")
            return name, _Variable(offset, length, packed, 0, OTHERS[17])
        shape_data = self._small(stream, 4 * 32)
        name = self._small(stream, LONGEST_NAME).decode("ascii", "replace")
        if number not in NUMBERS or word & COMPLEX:
            what = COMPLEX_NUMBERS if number in NUMBERS else OTHERS.get(number, f"class {number}")
            return name, _Variable(offset, length, packed, 0, what)
        shape = tuple(int(n) for n in np.frombuffer(shape_data, dtype=self._order + "i4"))
        kind, count, inline = self._tag(stream)
        if kind not in STORED:
            return name, _Variable(offset, length, packed, 0, f"data of type {kind}")
        stored = np.dtype(self._order + STORED[kind])
        if any(n < 0 for n in shape) or count != math.prod(shape) * stored.itemsize:
            raise InvalidInput(name, f"shape {shape} and {count} bytes of {stored}", "as many as it says")
        begin = stream.position - (4 if inline else 0)
        dtype = np.dtype(NUMBERS[number])
        if dtype.kind != "f" and stored.kind == "f":
            raise InvalidInput(name, f"{dtype} stored as {stored}", "integers stored as integers")
        return name, _Variable(offset, length, packed, begin, (shape, dtype, stored))

    def _small(self, stream: Stream, most: int) -> bytes:
        """Content of a short element; skips its padding."""
        _, count, inline = self._tag(stream)
        if count > most:
            raise InvalidInput("file", f"{count} bytes in a header", "a whole MATLAB file")
        if inline:
            # The four bytes were read with the tag.
            return stream.last[4 : 4 + count]
        data = stream.read(count)
        stream.skip(-count % 8)
        return data

    def _tag(self, stream: Stream) -> tuple[int, int, bool]:
        """Type, size, and whether the data are in the tag itself."""
        kind, count = struct.unpack(self._order + "II", stream.read(8))
        if kind >> 16:
            return kind & 0xFFFF, min(kind >> 16, 4), True
        return kind, count, False

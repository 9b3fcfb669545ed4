"""MATLAB files of version 5 (6, 7), read by SciPy: plain arrays of numbers.

Cells, structures, objects, functions and opaque data are named but never read.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..files.bounded_reading import check_declared, check_row
from ..files.damage import ACCEPTED, rejecting_damage

START = b"MATLAB 5.0 MAT-file"

# Types of the classes of numeric arrays, and other classes in words.
NUMBERS = {
    name: np.dtype(name.replace("single", "float32").replace("double", "float64"))
    for name in ("double", "single", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
} | {"logical": np.dtype("uint8")}
OTHERS = {
    "cell": "a cell",
    "struct": "a structure",
    "object": "an object",
    "char": "text",
    "sparse": "a sparse matrix",
    "function": "a function",
}
COMPLEX_NUMBERS = "complex numbers"

# "MAT-File Format", The MathWorks, chapter 1: a compressed element; bytes of the header of the file, and
# those of an element that hold the header of its array; classes, stored types and flag of complex numbers.
COMPRESSED, HEADER_BYTES, ENOUGH_BYTES = 15, 128, 4096
CLASSES, STORED, COMPLEX = range(6, 16), (1, 2, 3, 4, 5, 6, 7, 9, 12, 13), 0x0800

MAX_VARIABLES = 1000
# Largest compression ratio of zlib is 1032; a number of 8 bytes may be stored in one.
PACKING = 8 * 1100.0


class Matlab5:
    """The arrays of one file; see ``Arrays``. Axes are reversed, as stored.

    Raises:
        InvalidInput: for a damaged file.
    """

    kind = "a MATLAB 5 file"
    reversed_axes = True

    def __init__(self, path: Path) -> None:
        self._path = path
        with _rejecting_damage("file"), path.open("rb") as file:
            self._plain = _plain_arrays(file)
            file.seek(0)
            listed = _scipy_io().whosmat(file)
        if len(listed) > MAX_VARIABLES:
            raise InvalidInput("file", f"{len(listed)} variables", f"at most {MAX_VARIABLES}")
        self._variables = {name: (shape, kind) for name, shape, kind in listed}
        for name in self._plain:
            if sum(name == other for other, *_ in listed) > 1:
                raise InvalidInput("file", f"two variables {name}", "variables of different names")

    def names(self) -> tuple[str, ...]:
        return tuple(self._variables)

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        if name not in self._variables:
            return None
        shape, kind = self._variables[name]
        if kind not in NUMBERS or name not in self._plain:
            raise InvalidInput(name, OTHERS.get(kind, kind), "a plain array of real numbers")
        if self._plain[name]:
            accepted = f"a plain array of real numbers; {ACCEPTED}"
            raise InvalidInput(name, COMPLEX_NUMBERS, accepted)
        dtype = NUMBERS[kind]
        check_declared(name, shape[::-1], dtype, self._path.stat().st_size, PACKING)
        return shape[::-1], dtype

    def whole(self, name: str) -> NDArray[Any]:
        declaration = self.declared(name)
        if declaration is None:
            raise InvalidInput(name, "nothing", "an array")
        shape, dtype = declaration
        with _rejecting_damage(name), self._path.open("rb") as file:
            array = _scipy_io().loadmat(file, variable_names=[name])[name]
            # A damaged NaN may signal, which is no reason to warn.
            with np.errstate(invalid="ignore"):
                return np.asarray(array.T, dtype=dtype).reshape(shape)

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        declaration = self.declared(name)
        if declaration is not None:
            check_row(name, *declaration)
        yield from self.whole(name)


def _scipy_io() -> Any:
    # Loaded when a file of this format is read: it takes longer than to read most others.
    from scipy import io

    return io


def _plain_arrays(file: IO[bytes]) -> dict[str, bool]:
    """The arrays of numbers by name, and whether the numbers are complex.

    Raises:
        InvalidInput: for numbers that are stored as another type, with which SciPy 1.17 ends the process.
    """
    complex_by_name = {}
    order = "<" if file.read(HEADER_BYTES)[-2:] == b"IM" else ">"
    while tag := file.read(8):
        kind, length = struct.unpack(order + "II", tag)
        after = file.tell() + length
        array = file.read(min(length, ENOUGH_BYTES))
        if kind == COMPRESSED:
            array = zlib.decompressobj().decompress(array, ENOUGH_BYTES)[8:]
        file.seek(after)
        # Flags of 16 bytes, dimensions, name, numbers.
        (flags,) = struct.unpack_from(order + "I", array, 8)
        if flags & 0xFF not in CLASSES:
            continue
        at, elements = 16, []
        for _ in range(3):
            stored, count = struct.unpack_from(order + "II", array, at)
            # Short elements have their size in the upper half of the type, and are in the tag.
            short = stored >> 16
            begin, size = (at + 4, short) if short else (at + 8, count)
            elements.append((stored & 0xFFFF, array[begin : begin + size]))
            at += 8 if short else 8 + count + -count % 8
        if elements[-1][0] not in STORED:
            raise InvalidInput("file", f"numbers stored as type {elements[-1][0]}", "a whole MATLAB file")
        complex_by_name[elements[1][1].decode("latin-1")] = bool(flags & COMPLEX)
    return complex_by_name


@contextmanager
def _rejecting_damage(name: str) -> Iterator[None]:
    """Convert what SciPy raises on damaged data, and silence what it warns of."""
    with rejecting_damage(name, "a whole MATLAB file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield

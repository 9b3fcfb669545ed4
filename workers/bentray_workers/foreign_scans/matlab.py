"""MATLAB files: of version 5 (6, 7), read by SciPy, and 7.3, which is HDF5; plain arrays of numbers.

Cells, structures, objects, functions and opaque data of version 5 are named but never read.
"""

import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from ..files.bounded_reading import check_declared, check_row
from ..files.damage import ACCEPTED, rejecting_damage
from ..files.dataset.counts import BLOCK_BYTES
from ..files.hdf5_reading import Reader, rejecting_hdf5_damage

START = b"MATLAB 5.0 MAT-file"

PLAIN = "a plain array of real numbers"
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
            raise InvalidInput(name, OTHERS.get(kind, kind), PLAIN)
        if self._plain[name]:
            accepted = f"{PLAIN}; {ACCEPTED}"
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


class Matlab73:
    """The arrays of one file; see ``Arrays``. MATLAB stores them with reversed axes.

    Args:
        reader: of the file.
        is_matlab: whether the file has the header of MATLAB.
    """

    reversed_axes = True

    def __init__(self, reader: Reader, *, is_matlab: bool = True) -> None:
        self._reader = reader
        self.kind = "a MATLAB 7.3 file" if is_matlab else "an HDF5 file"

    def names(self) -> tuple[str, ...]:
        return self._reader.names()

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        stored = self._reader.checked(name, "iuf", PLAIN) if self._reader.contains(name) else None
        if stored is None:
            return None
        # MATLAB marks empty arrays and stores their shape as numbers.
        if self._reader.attribute(name, "MATLAB_empty") is not None:
            raise InvalidInput(name, "an empty array", PLAIN)
        return stored.shape, stored.dtype

    def whole(self, name: str) -> NDArray[Any]:
        return self._reader.required(name, "iuf", PLAIN)

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        stored = self._reader.checked(name, "iuf", PLAIN)
        if stored is None:
            raise InvalidInput(name, "nothing", PLAIN)
        check_row(name, stored.shape, stored.dtype)
        yield from rows_of(stored, name)


def rows_of(stored: h5py.Dataset, name: str, before: tuple[int, ...] = ()) -> Iterator[NDArray[Any]]:
    """The rows of an array along one axis, in blocks, so that a chunk is decompressed once or few times.

    Args:
        stored: checked array, whose rows fit into the memory.
        name: for errors.
        before: indices of the axes before that of the rows.
    """
    axis = len(before)
    count = stored.shape[axis]
    row_bytes = max(1, stored.dtype.itemsize * int(np.prod(stored.shape[axis + 1 :], dtype=np.int64)))
    chunk = 1 if stored.chunks is None else stored.chunks[axis]
    block = max(1, min(chunk, BLOCK_BYTES // row_bytes))
    for begin in range(0, count, block):
        with rejecting_hdf5_damage(name, PLAIN):
            rows = np.asarray(stored[(*before, slice(begin, begin + block))])
        yield from rows

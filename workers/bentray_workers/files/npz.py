"""NumPy archives of plain arrays: a zip of .npy files; nothing is unpickled."""

import math
import zipfile
from collections.abc import Iterator
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.errors import InvalidInput

from .bounded_reading import at_end, check_declared, check_row
from .damage import rejecting_damage
from .npy_headers import read_header
from .zip_checks import PACKING, check_zip

START = b"PK\x03\x04"
SUFFIX = ".npy"
MAX_MEMBERS = 1000

WHOLE = "a whole .npz of plain arrays"


class Npz:
    """The arrays of one archive; see ``foreign_scans.arrays.Arrays``.

    Args:
        archive: open archive, or a file with one.

    Raises:
        InvalidInput: for a damaged archive.
    """

    kind = "a NumPy archive"
    reversed_axes = False

    def __init__(self, archive: zipfile.ZipFile | IO[bytes]) -> None:
        with rejecting_damage("file", WHOLE):
            self._zip = archive if isinstance(archive, zipfile.ZipFile) else zipfile.ZipFile(archive)
            check_zip(self._zip, MAX_MEMBERS)
        self._members = {
            member.filename.removesuffix(SUFFIX): member
            for member in self._zip.infolist()
            if member.filename.endswith(SUFFIX)
        }

    def names(self) -> tuple[str, ...]:
        return tuple(self._members)

    def header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """Shape and type of any array, unchecked."""
        with rejecting_damage(name, WHOLE), self._open(name) as file:
            shape, _, dtype = read_header(file)
        return shape, dtype

    def declared(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
        if name not in self._members:
            return None
        with rejecting_damage(name, WHOLE), self._open(name) as file:
            shape, _, dtype = self._header(name, file)
        return shape, dtype

    def whole(self, name: str) -> NDArray[Any]:
        with rejecting_damage(name, WHOLE), self._open(name) as file:
            shape, fortran, dtype = self._header(name, file)
            data = _exactly(name, file, math.prod(shape) * dtype.itemsize)
            self._check_end(name, file)
            flat = np.frombuffer(data, dtype=dtype)
            return flat.reshape(shape[::-1]).T if fortran else flat.reshape(shape)

    def rows(self, name: str) -> Iterator[NDArray[Any]]:
        with self._open(name) as file:
            with rejecting_damage(name, WHOLE):
                shape, fortran, dtype = self._header(name, file)
            if fortran and len(shape) > 1:
                raise InvalidInput(name, "an array in Fortran order", "numpy.ascontiguousarray of it")
            check_row(name, shape, dtype)
            for _ in range(shape[0]):
                with rejecting_damage(name, WHOLE):
                    data = _exactly(name, file, math.prod(shape[1:]) * dtype.itemsize)
                yield np.frombuffer(data, dtype=dtype).reshape(shape[1:])
            with rejecting_damage(name, WHOLE):
                self._check_end(name, file)

    def _open(self, name: str) -> IO[bytes]:
        with rejecting_damage(name, WHOLE):
            return self._zip.open(self._members[name])

    def _check_end(self, name: str, file: IO[bytes]) -> None:
        """Check that the values end with the member, by its bytes and by the directory."""
        at_end(file)
        declared = self._members[name].file_size
        if file.tell() != declared:
            raise InvalidInput(name, f"{file.tell()} bytes, {declared} in the directory", WHOLE)

    def _header(self, name: str, file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
        shape, fortran, dtype = read_header(file)
        if dtype.hasobject:
            raise InvalidInput(name, "Python objects", "plain numbers; nothing is unpickled")
        check_declared(name, shape, dtype, self._members[name].compress_size, PACKING)
        return shape, fortran, dtype


def _exactly(name: str, file: IO[bytes], count: int) -> bytes:
    data = file.read(count)
    if len(data) < count:
        raise InvalidInput(name, f"{len(data)} bytes of data", f"{count}, as its header says")
    return data

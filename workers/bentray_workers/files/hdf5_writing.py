"""Atomic writing of HDF5 files, with an ordinary error on a full disk, on which HDF5 itself crashes."""

import io
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import h5py

from .atomic import atomic_replace


@contextmanager
def atomic_hdf5(target: Path, name: str = "", version: str = "") -> Iterator[h5py.File]:
    """A new HDF5 file that atomically replaces the target at the end of the context.

    Args:
        target: path of the file.
        name, version: of its format, as ``Reader.check_format`` finds them; empty: none.

    Raises:
        OSError: where the folder cannot be written to or the disk is full.
    """
    with atomic_replace(target) as partial, io.FileIO(partial, "x+") as raw:
        sink = _Sink(raw)
        try:
            with h5py.File(sink, "w") as file:
                if name:
                    file.attrs["format"], file.attrs["format_version"] = name, version
                yield file
        finally:
            if sink.failure is not None:
                # The cause of any further error of HDF5.
                raise OSError(sink.failure.errno, sink.failure.strerror, str(target)) from sink.failure


def write_packed(file: h5py.File, arrays: Mapping[str, Any]) -> None:
    """Write arrays compressed; None is left out."""
    for name, values in arrays.items():
        if values is not None:
            file.create_dataset(name, data=values, compression="gzip", shuffle=True, track_times=False)


class _Sink(io.RawIOBase):
    """A file for HDF5 that stores its first failure and ignores later writes.

    HDF5 cannot close a file whose writes fail: it frees memory that it still uses.
    """

    def __init__(self, raw: io.FileIO) -> None:
        self._raw = raw
        self.failure: OSError | None = None

    def write(self, data: Any) -> int:
        left = memoryview(data).cast("B")
        length = len(left)
        try:
            while left and self.failure is None:
                left = left[self._raw.write(left) :]
        except OSError as error:
            self.failure = error
        return length

    def readinto(self, buffer: Any) -> int:
        return cast(int, self._raw.readinto(buffer))

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        return self._raw.tell()

    def truncate(self, size: int | None = None) -> int:
        try:
            return self._raw.truncate(size)
        except OSError as error:
            self.failure = self.failure or error
            return self._raw.tell()

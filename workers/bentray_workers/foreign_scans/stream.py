"""Incremental decompression of a part of a file."""

from __future__ import annotations

import zlib
from typing import IO

from bentray_kernels.errors import InvalidInput

PIECE_BYTES = 1 << 20


class Stream:
    """The content of one element, decompressed as it is read."""

    def __init__(self, file: IO[bytes], offset: int, stored: int, packed: bool, name: str) -> None:
        self._file = file
        self._next = offset
        self._left = stored
        self._unpack = zlib.decompressobj() if packed else None
        self._name = name
        self.position = 0
        self.last = b""

    def read(self, count: int) -> bytes:
        """Read exactly so many bytes.

        Raises:
            InvalidInput: for fewer bytes in the file.
        """
        parts, left = [], count
        while left:
            part = self._some(min(left, PIECE_BYTES))
            if not part:
                raise InvalidInput(
                    self._name, f"{count - left} bytes of data", f"{count}, as its header says"
                )
            parts.append(part)
            left -= len(part)
        self.last = b"".join(parts)
        self.position += count
        return self.last

    def skip(self, count: int) -> None:
        """Skip bytes."""
        while count:
            part = min(count, PIECE_BYTES)
            self.read(part)
            count -= part

    def end(self, tail: int) -> None:
        """Check that a compressed element ends here; zlib then verifies its check sum.

        Args:
            tail: bytes of padding that may follow.

        Raises:
            InvalidInput: for more data, a missing end, or a wrong check sum.
        """
        if self._unpack is None:
            return
        while part := self._some(tail + 1):
            tail -= len(part)
            if tail < 0:
                raise InvalidInput(self._name, "more data than its header declares", "whole data")
        if not self._unpack.eof:
            raise InvalidInput(self._name, "packed data without their end", "whole data")

    def _some(self, most: int) -> bytes:
        if self._unpack is None:
            return self._stored(most)
        while True:
            waiting = self._unpack.unconsumed_tail or self._stored(PIECE_BYTES)
            if not waiting:
                return b""
            try:
                part = self._unpack.decompress(waiting, most)
            except zlib.error as error:
                raise InvalidInput(self._name, f"damaged data ({error})", "whole data") from None
            if part:
                return part
            if self._unpack.eof:
                return b""

    def _stored(self, most: int) -> bytes:
        self._file.seek(self._next)
        part = self._file.read(min(most, self._left))
        self._next += len(part)
        self._left -= len(part)
        return part

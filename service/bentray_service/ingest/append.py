"""Append to an upload that comes in pieces; one request at a time, and what came stays, however it ends."""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput

from ..refusals import Locked, UnknownChecksum, WrongChecksum
from .receive import pour

ALGORITHMS = ("sha256", "sha1", "md5")


@dataclass(frozen=True)
class Checksum:
    """What a piece should have as its digest."""

    algorithm: str
    digest: bytes

    @classmethod
    def of(cls, header: str) -> Self:
        """From a header as ``sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0=``.

        Raises:
            UnknownChecksum: for an algorithm that is not in ``ALGORITHMS``.
            InvalidInput: for anything that is no digest of it.
        """
        algorithm, _, text = header.strip().partition(" ")
        if algorithm not in ALGORITHMS:
            raise UnknownChecksum("Upload-Checksum", repr(algorithm[:40]), " or ".join(ALGORITHMS))
        try:
            digest = base64.b64decode(text.strip(), validate=True)
        except (binascii.Error, ValueError):
            digest = b""
        if len(digest) != _hasher(algorithm).digest_size:
            raise InvalidInput("Upload-Checksum", repr(text[:80]), f"the {algorithm} of the body in base 64")
        return cls(algorithm, digest)


class Hold:
    """Who is at work on which upload: one at a time."""

    def __init__(self) -> None:
        # Where each stood when it was held, as far as that matters.
        self._held: dict[str, int | None] = {}
        self._lock = threading.Lock()

    @contextmanager
    def __call__(self, upload_id: str) -> Iterator[None]:
        """Hold an upload.

        Raises:
            Locked: when it is held.
        """
        with self._lock:
            if upload_id in self._held:
                raise Locked("upload", f"{upload_id}, to which another request writes", "one at a time")
            self._held[upload_id] = None
        try:
            yield
        finally:
            with self._lock:
                del self._held[upload_id]

    def doubt(self, upload_id: str, offset: int) -> None:
        """What comes after ``offset`` counts once the upload is let go: it may be cut off again."""
        self._held[upload_id] = offset

    def sure(self, upload_id: str) -> int | None:
        """The offset beyond which there are doubts; None where there are none."""
        return self._held.get(upload_id)


async def append(
    stream: AsyncIterator[bytes], path: Path, offset: int, length: int, checksum: Checksum | None
) -> int:
    """Append a body to ``path``, durably, without blocking the event loop.

    What came before the client went away stays. With a checksum all of it counts, or nothing.

    Args:
        stream: the chunks of the body.
        path: the file, of ``offset`` bytes; made if it is not there.
        offset: where the body begins.
        length: of the whole upload, bytes.
        checksum: of the body.

    Returns:
        the size of the file now.

    Raises:
        TooLarge: when the body goes beyond ``length``.
        WrongChecksum, StorageFull: as their names say.
    """
    digest = _hasher(checksum.algorithm) if checksum is not None else None
    await run_in_threadpool(path.touch)
    file = await run_in_threadpool(path.open, "r+b", 0)
    whole = False
    try:
        await run_in_threadpool(file.seek, offset)
        accepted = f"at most {length - offset} bytes, up to the Upload-Length of {length}"
        size = await pour(stream, file, length - offset, accepted, digest)
        if checksum is not None and digest is not None:
            if not hmac.compare_digest(digest.digest(), checksum.digest):
                found = base64.b64encode(digest.digest()).decode()
                raise WrongChecksum("body", f"{checksum.algorithm} {found}", "what Upload-Checksum says")
            whole = True
    finally:
        if checksum is not None and not whole:
            await run_in_threadpool(file.truncate, offset)
        await run_in_threadpool(file.close)
    return offset + size


def size_of(path: Path) -> int:
    """Bytes that are there, of a file that is not made before the first of them."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def _hasher(algorithm: str) -> hashlib._Hash:
    # SHA-1 and MD5 find what went wrong on the way; nothing rests on them.
    return hashlib.new(algorithm, usedforsecurity=False)

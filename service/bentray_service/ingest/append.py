"""Appending to a resumable upload: one request at a time, durable, with optional checksum."""

from __future__ import annotations

import base64
import hashlib
import hmac
import math
import os
import re
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import sync, write_bytes

from ..errors import Locked, UnknownChecksum, WrongChecksum
from .receive import write_body

# Algorithms, with the format of the digest in base 64.
ALGORITHMS = {
    "sha256": "[A-Za-z0-9+/]{43}=",
    "sha1": "[A-Za-z0-9+/]{27}=",
    "md5": "[A-Za-z0-9+/]{22}==",
}
CHECKSUM = "^(" + "|".join(f"{name} {digest}" for name, digest in ALGORITHMS.items()) + ")$"


@dataclass(frozen=True)
class Checksum:
    """Expected digest of a request body."""

    algorithm: str
    digest: bytes

    @classmethod
    def from_header(cls, header: str) -> Self:
        """Parse a header such as ``sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0=``.

        Raises:
            UnknownChecksum: for an algorithm that is not in ``ALGORITHMS``.
            InvalidInput: for an invalid digest.
        """
        algorithm, _, text = header.partition(" ")
        if algorithm not in ALGORITHMS:
            raise UnknownChecksum("Upload-Checksum", repr(algorithm[:40]), " or ".join(ALGORITHMS))
        if not re.fullmatch(CHECKSUM, header):
            raise InvalidInput("Upload-Checksum", repr(text[:80]), f"the {algorithm} of the body in base 64")
        return cls(algorithm, base64.b64decode(text))


class UploadLocks:
    """Locks of uploads: one request per upload at a time."""

    def __init__(self) -> None:
        self._held: set[str] = set()
        self._lock = threading.Lock()

    @contextmanager
    def __call__(self, upload_id: str) -> Iterator[None]:
        """Lock an upload within the block.

        Raises:
            Locked: when another request has locked it.
        """
        with self._lock:
            if upload_id in self._held:
                raise Locked("upload", f"{upload_id}, used by another request", "one request at a time")
            self._held.add(upload_id)
        try:
            yield
        finally:
            with self._lock:
                self._held.remove(upload_id)


async def append(
    stream: AsyncIterator[bytes], path: Path, offset: int, length: int, checksum: Checksum | None
) -> int:
    """Append a body to ``path``, durably, without blocking the event loop.

    Data received before the client disconnects is kept, even if this process dies. With a checksum, all or
    none
    of the body is kept: until verification, a file next to ``path`` stores the offset of the body.

    Args:
        stream: the chunks of the body.
        path: a file of ``offset`` bytes; created if needed.
        offset: of the body.
        length: total size of the upload, bytes.
        checksum: of the body.

    Returns:
        the new size of the file.

    Raises:
        TooLarge: when the body exceeds ``length``.
        WrongChecksum, StorageFull: as their names say.
    """
    digest = _hasher(checksum.algorithm) if checksum is not None else None
    await run_in_threadpool(_begin, path, offset if checksum is not None else None)
    file = await run_in_threadpool(path.open, "r+b", 0)
    try:
        await run_in_threadpool(file.seek, offset)
        accepted = f"at most {length - offset} bytes, up to the Upload-Length of {length}"
        size = await write_body(stream, file, length - offset, accepted, digest)
        if checksum is not None and digest is not None:
            if not hmac.compare_digest(digest.digest(), checksum.digest):
                value = base64.b64encode(digest.digest()).decode()
                raise WrongChecksum("body", f"{checksum.algorithm} {value}", "the value of Upload-Checksum")
            await run_in_threadpool(_verified, path)
    finally:
        await run_in_threadpool(file.close)
        await run_in_threadpool(discard_unverified, path)
    return offset + size


def received_bytes(path: Path) -> int:
    """Number of verified bytes; 0 if the file does not exist."""
    # Read before and after, since a request may start or end in between.
    before = _unverified_from(path)
    try:
        size = path.stat().st_size
    except FileNotFoundError:
        return 0
    return int(min(size, before, _unverified_from(path)))


def discard_unverified(path: Path) -> None:
    """Remove data with an unverified checksum, also after a crash."""
    begin = _unverified_from(path)
    if begin != math.inf:
        with path.open("r+b") as file:
            file.truncate(int(begin))
            os.fsync(file.fileno())
        _verified(path)


def remove(path: Path) -> None:
    """Delete the data of an upload."""
    path.unlink(missing_ok=True)
    _mark(path).unlink(missing_ok=True)


def _begin(path: Path, unverified_from: int | None) -> None:
    """Create the file if needed; store the offset of unverified data durably."""
    path.touch()
    discard_unverified(path)
    if unverified_from is not None:
        write_bytes(_mark(path), str(unverified_from).encode())


def _verified(path: Path) -> None:
    _mark(path).unlink()
    sync(path.parent)


def _unverified_from(path: Path) -> float:
    """The offset of unverified data; infinity if there is none."""
    try:
        return int(_mark(path).read_text())
    except FileNotFoundError:
        return math.inf


def _mark(path: Path) -> Path:
    return path.with_name(f"{path.name}.unverified")


def _hasher(algorithm: str) -> hashlib._Hash:
    # SHA-1 and MD5 detect transmission errors; they have no security purpose.
    return hashlib.new(algorithm, usedforsecurity=False)

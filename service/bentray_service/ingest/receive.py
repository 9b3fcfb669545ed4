"""Streaming of request bodies to disk: whole ones, and parts of resumable uploads with optional checksum."""

from __future__ import annotations

import asyncio
import base64
import errno
import hashlib
import hmac
import math
import os
import re
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Self

from starlette.concurrency import run_in_threadpool

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.atomic import sync, write_bytes

from ..errors import EmptyBody, Locked, QuotaExceeded, StorageFull, TooLarge, UnknownChecksum, WrongChecksum
from ..rows.checksums import Digest

# Size of a batch; chunks are written without copying them together.
BATCH_BYTES, BATCH_CHUNKS = 4 * 1024 * 1024, 1024
# Interval between syncs to disk, bytes.
SYNC_BYTES = 64 * 1024 * 1024

# Algorithms, with the format of the digest in base 64.
ALGORITHMS = {
    "sha256": "[A-Za-z0-9+/]{43}=",
    "sha1": "[A-Za-z0-9+/]{27}=",
    "md5": "[A-Za-z0-9+/]{22}==",
}
CHECKSUM = "^(" + "|".join(f"{name} {digest}" for name, digest in ALGORITHMS.items()) + ")$"


def check_announced(announced: int | None, limit: int, expected: str) -> None:
    """Reject a body by its Content-Length, before anything is reserved or read; as ``receive``."""
    if announced == 0:
        raise EmptyBody("body", "0 bytes", expected)
    if announced is not None and announced > limit:
        raise TooLarge("body", f"{announced} bytes", f"at most {limit} bytes (BENTRAY_MAX_UPLOAD_BYTES)")


async def receive(
    stream: AsyncIterator[bytes],
    announced: int | None,
    path: Path,
    limit: int,
    expected: str,
    reserve: Callable[[int], None] = lambda size: None,
) -> Digest:
    """Write a body to ``path``, durably, without blocking the event loop.

    Args:
        stream: the chunks of the body.
        announced: Content-Length, if given.
        path: a new file; the caller deletes it.
        limit: maximum size, bytes.
        expected: description of the expected content.
        reserve: called in a thread to reserve more than ``announced`` bytes; may raise a refusal.

    Raises:
        TooLarge, EmptyBody, StorageFull: as their names say.
    """
    check_announced(announced, limit, expected)
    accepted = f"at most {limit} bytes (BENTRAY_MAX_UPLOAD_BYTES)"
    digest = hashlib.sha256()
    growing = _GrowingReservation(announced or 0, limit, reserve)
    file = await run_in_threadpool(path.open, "xb", 0)
    try:
        size = await write_body(stream, file, limit, accepted, digest, growing.make_room)
    finally:
        await run_in_threadpool(file.close)
    if not size:
        raise EmptyBody("body", "0 bytes", expected)
    return Digest(size, digest.hexdigest())


async def write_body(
    stream: AsyncIterator[bytes],
    file: FileIO,
    limit: int,
    accepted: str,
    digest: hashlib._Hash | None,
    make_room: Callable[[int], None] = lambda size: None,
) -> int:
    """Write a body to the end of an open file and sync it; data received before an error is kept.

    Args:
        stream: the chunks.
        file: unbuffered, so that nothing is written after an error.
        limit: maximum number of bytes.
        accepted: description of the limit.
        digest: updated with all data.
        make_room: called in a thread with the new size before the file grows.

    Returns:
        the number of bytes.

    Raises:
        TooLarge, StorageFull: as their names say.
    """
    size, batch, held, behind = 0, [], 0, _BatchWriter(file, digest, make_room)
    try:
        try:
            async for chunk in stream:
                if size + len(chunk) > limit:
                    raise TooLarge("body", f"more than {limit} bytes", accepted)
                size += len(chunk)
                batch.append(chunk)
                held += len(chunk)
                if held >= BATCH_BYTES or len(batch) >= BATCH_CHUNKS:
                    await behind.write(batch)
                    batch, held = [], 0
        finally:
            # After a failed write, further data would have the wrong offset.
            if not behind.failed:
                await behind.write(batch)
                await behind.end()
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise StorageFull(
                "body", f"no space after {size} bytes", "a smaller file, or more disk space"
            ) from error
        raise
    return size


class _GrowingReservation:
    """The reservation of a body; without Content-Length it is doubled each time."""

    def __init__(self, reserved: int, limit: int, reserve: Callable[[int], None]) -> None:
        self._reserved = reserved
        self._limit = limit
        self._reserve = reserve

    def make_room(self, size: int) -> None:
        """Reserve at least ``size`` bytes."""
        if size <= self._reserved:
            return
        for reservation in (min(2 * size, self._limit), size):
            try:
                self._reserve(reservation)
            except QuotaExceeded:
                if reservation == size:
                    raise
            else:
                self._reserved = reservation
                return


class _BatchWriter:
    """Writes batches in a thread while the next one is received.

    Attributes:
        failed: whether a write has failed; nothing more may be written then.
    """

    def __init__(self, file: FileIO, digest: hashlib._Hash | None, make_room: Callable[[int], None]) -> None:
        self._file = file
        self._digest = digest
        self._make_room = make_room
        self._size = 0
        self._running: asyncio.Task[None] | None = None
        self._unsynced = 0
        self.failed = False

    async def write(self, batch: list[bytes]) -> None:
        """Write a batch after the previous one."""
        await self._settle()
        self._running = asyncio.create_task(run_in_threadpool(self._write, batch))

    async def end(self) -> None:
        """Wait until all data is on disk."""
        await self._settle()
        await run_in_threadpool(os.fdatasync, self._file.fileno())

    async def _settle(self) -> None:
        if self._running is not None:
            running, self._running = self._running, None
            try:
                await running
            except BaseException:
                self.failed = True
                raise

    def _write(self, batch: list[bytes]) -> None:
        self._size += sum(map(len, batch))
        self._make_room(self._size)
        if self._digest is not None:
            for chunk in batch:
                self._digest.update(chunk)
        for chunk in batch:
            left = memoryview(chunk)
            while left:
                left = left[self._file.write(left) :]
            self._unsynced += len(chunk)
        if self._unsynced >= SYNC_BYTES:
            os.fdatasync(self._file.fileno())
            self._unsynced = 0


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
    # SHA-1 and MD5 detect transmission errors; they have no security purpose.
    digest = hashlib.new(checksum.algorithm, usedforsecurity=False) if checksum is not None else None
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

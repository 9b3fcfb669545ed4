"""Streaming of a request body to disk."""

from __future__ import annotations

import asyncio
import errno
import hashlib
import os
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

from starlette.concurrency import run_in_threadpool

from ..errors import EmptyBody, QuotaExceeded, StorageFull, TooLarge

# Size of a batch; chunks are written without copying them together.
BATCH_BYTES, BATCH_CHUNKS = 4 * 1024 * 1024, 1024
# Interval between syncs to disk, bytes.
SYNC_BYTES = 64 * 1024 * 1024


@dataclass(frozen=True)
class Received:
    """Size of a body, and its SHA-256 in hexadecimal."""

    size: int
    sha256: str


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
) -> Received:
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
    return Received(size, digest.hexdigest())


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

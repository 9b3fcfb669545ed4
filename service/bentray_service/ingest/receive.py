"""Stream the body of an upload to disk, counted while it is read."""

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

from ..refusals import EmptyBody, QuotaExceeded, StorageFull, TooLarge

# Chunks wait as they came, which saves copying them together; a client may send tiny ones.
BATCH_BYTES, BATCH_CHUNKS = 4 * 1024 * 1024, 1024
# What a power cut may cost of a body, and how much of it waits for the disk at most.
SYNC_BYTES = 64 * 1024 * 1024


@dataclass(frozen=True)
class Received:
    """How many bytes came, and their SHA-256 in hexadecimal."""

    size: int
    sha256: str


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
        announced: the Content-Length, if there was one; too large a one is refused before a byte is read.
        path: the file to make; the caller removes it.
        limit: largest size, bytes.
        expected: what the body should hold, for the refusal of an empty one.
        reserve: called in a thread before more is written than was announced, with the size that there may be
            then; it may refuse.

    Raises:
        TooLarge, EmptyBody, StorageFull: as their names say.
    """
    if announced == 0:
        raise EmptyBody("body", "0 bytes", expected)
    accepted = f"at most {limit} bytes (BENTRAY_MAX_UPLOAD_BYTES)"
    if announced is not None and announced > limit:
        raise TooLarge("body", f"{announced} bytes", accepted)
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
    """Write what comes to the end of an open file, one batch while the next one comes, and sync it.

    Whatever ends it, all that came before is in the file.

    Args:
        stream: the chunks.
        file: where they go, unbuffered: what a full disk refused must not come later.
        limit: at most so many bytes; those that go beyond are not written.
        accepted: the limit in words.
        digest: fed with all that is written.
        make_room: called in a thread before the file grows, with its size then.

    Returns:
        how many bytes came.

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
            # After a write that failed, what follows would stand in the wrong place.
            if not behind.failed:
                await behind.write(batch)
                await behind.end()
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise StorageFull(
                "body", f"no space after {size} bytes", "a smaller file, or a larger disk"
            ) from error
        raise
    return size


class _GrowingReservation:
    """What is reserved for a body; one without a length has twice as much each time, so that few calls do."""

    def __init__(self, reserved: int, limit: int, reserve: Callable[[int], None]) -> None:
        self._reserved = reserved
        self._limit = limit
        self._reserve = reserve

    def make_room(self, size: int) -> None:
        """Reserve room for ``size`` bytes, if there is none yet."""
        if size <= self._reserved:
            return
        for wanted in (min(2 * size, self._limit), size):
            try:
                self._reserve(wanted)
            except QuotaExceeded:
                if wanted == size:
                    raise
            else:
                self._reserved = wanted
                return


class _BatchWriter:
    """Writes a batch in a thread while the next one comes.

    Attributes:
        failed: whether a write has; nothing more may be written then.
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
        """Begin to write, once the batch before is written."""
        await self._settle()
        self._running = asyncio.create_task(run_in_threadpool(self._write, batch))

    async def end(self) -> None:
        """See all of it on the disk."""
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

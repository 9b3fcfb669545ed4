"""Stream the body of an upload to disk, counted while it is read."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from starlette.concurrency import run_in_threadpool

from ..refusals import EmptyBody, StorageFull, TooLarge

BATCH_BYTES = 4 * 1024 * 1024


@dataclass(frozen=True)
class Received:
    """How many bytes came, and their SHA-256 in hexadecimal."""

    size: int
    sha256: str


async def receive(
    stream: AsyncIterator[bytes], announced: int | None, path: Path, limit: int, expected: str
) -> Received:
    """Write a body to ``path``, durably, without blocking the event loop.

    Args:
        stream: the chunks of the body.
        announced: the Content-Length, if there was one; too large a one is refused before a byte is read.
        path: the file to make; the caller removes it.
        limit: largest size, bytes.
        expected: what the body should hold, for the refusal of an empty one.

    Raises:
        TooLarge, EmptyBody, StorageFull: as their names say.
    """
    if announced == 0:
        raise EmptyBody("body", "0 bytes", expected)
    if announced is not None and announced > limit:
        raise _too_large(f"{announced} bytes", limit)
    digest, size, batch = hashlib.sha256(), 0, bytearray()
    file = await run_in_threadpool(path.open, "xb")
    try:
        async for chunk in stream:
            size += len(chunk)
            if size > limit:
                raise _too_large(f"more than {limit} bytes", limit)
            batch += chunk
            if len(batch) >= BATCH_BYTES:
                await run_in_threadpool(_write, file, bytes(batch), digest)
                batch.clear()
        if not size:
            raise EmptyBody("body", "0 bytes", expected)
        await run_in_threadpool(_write, file, bytes(batch), digest)
        await run_in_threadpool(os.fsync, file.fileno())
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise StorageFull(
                "body", f"no space after {size} bytes", "a smaller file, or a larger disk"
            ) from error
        raise
    finally:
        await run_in_threadpool(file.close)
    return Received(size, digest.hexdigest())


def _write(file: IO[bytes], batch: bytes, digest: hashlib._Hash) -> None:
    digest.update(batch)
    file.write(batch)
    file.flush()


def _too_large(found: str, limit: int) -> TooLarge:
    return TooLarge("body", found, f"at most {limit} bytes (BENTRAY_MAX_UPLOAD_BYTES)")

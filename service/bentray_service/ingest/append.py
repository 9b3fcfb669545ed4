"""Append to an upload that comes in pieces; one request at a time, and what came stays, however it ends."""

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

from ..refusals import Locked, UnknownChecksum, WrongChecksum
from .receive import write_body

# Each with the form of its digest in base 64.
ALGORITHMS = {
    "sha256": "[A-Za-z0-9+/]{43}=",
    "sha1": "[A-Za-z0-9+/]{27}=",
    "md5": "[A-Za-z0-9+/]{22}==",
}
CHECKSUM = "^(" + "|".join(f"{name} {digest}" for name, digest in ALGORITHMS.items()) + ")$"


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
        algorithm, _, text = header.partition(" ")
        if algorithm not in ALGORITHMS:
            raise UnknownChecksum("Upload-Checksum", repr(algorithm[:40]), " or ".join(ALGORITHMS))
        if not re.fullmatch(CHECKSUM, header):
            raise InvalidInput("Upload-Checksum", repr(text[:80]), f"the {algorithm} of the body in base 64")
        return cls(algorithm, base64.b64decode(text))


class UploadLocks:
    """Who is at work on which upload: one at a time."""

    def __init__(self) -> None:
        self._held: set[str] = set()
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

    What came before the client went away stays, also when this process dies. With a checksum all of it
    counts, or nothing: until it is verified a file beside ``path`` says where it begins.

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
    await run_in_threadpool(_begin, path, offset if checksum is not None else None)
    file = await run_in_threadpool(path.open, "r+b", 0)
    try:
        await run_in_threadpool(file.seek, offset)
        accepted = f"at most {length - offset} bytes, up to the Upload-Length of {length}"
        size = await write_body(stream, file, length - offset, accepted, digest)
        if checksum is not None and digest is not None:
            if not hmac.compare_digest(digest.digest(), checksum.digest):
                found = base64.b64encode(digest.digest()).decode()
                raise WrongChecksum("body", f"{checksum.algorithm} {found}", "what Upload-Checksum says")
            await run_in_threadpool(_verified, path)
    finally:
        await run_in_threadpool(file.close)
        await run_in_threadpool(discard_unverified, path)
    return offset + size


def received_bytes(path: Path) -> int:
    """Bytes that are there and count, of a file that is not made before the first of them."""
    # Asked before and after, for a piece may begin or end meanwhile.
    before = _unverified_from(path)
    try:
        size = path.stat().st_size
    except FileNotFoundError:
        return 0
    return int(min(size, before, _unverified_from(path)))


def discard_unverified(path: Path) -> None:
    """Cut off what came of a piece whose checksum was not verified, also by a process that died."""
    begin = _unverified_from(path)
    if begin != math.inf:
        with path.open("r+b") as file:
            file.truncate(int(begin))
            os.fsync(file.fileno())
        _verified(path)


def remove(path: Path) -> None:
    """Remove what came of an upload."""
    path.unlink(missing_ok=True)
    _mark(path).unlink(missing_ok=True)


def _begin(path: Path, unverified_from: int | None) -> None:
    """Make the file if it is not there; before any byte of a piece to verify comes, say so durably."""
    path.touch()
    discard_unverified(path)
    if unverified_from is not None:
        write_bytes(_mark(path), str(unverified_from).encode())


def _verified(path: Path) -> None:
    _mark(path).unlink()
    sync(path.parent)


def _unverified_from(path: Path) -> float:
    """The offset from which on nothing counts; infinity where all of it does."""
    try:
        return int(_mark(path).read_text())
    except FileNotFoundError:
        return math.inf


def _mark(path: Path) -> Path:
    return path.with_name(f"{path.name}.unverified")


def _hasher(algorithm: str) -> hashlib._Hash:
    # SHA-1 and MD5 find what went wrong on the way; nothing rests on them.
    return hashlib.new(algorithm, usedforsecurity=False)

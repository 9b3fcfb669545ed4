"""The flow of an upload with tus, continued after broken connections."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Literal

import httpx

from bentray_kernels.errors import InvalidInput

from ..routes.models.upload_records import DirectUploadRecord, PartAddresses, UploadRecord
from .connection import CHUNK_BYTES, Flow, PauseStep, RequestStep
from .errors import ClientError, NoAnswer, from_problem
from .lists import answer

UploadKind = Literal["dataset", "volume", "mesh"]
OnBytes = Callable[[int, int], None]

# Path of each kind.
PLACES: Mapping[str, str] = {"dataset": "/v1/datasets", "volume": "/v1/volumes", "mesh": "/v1/meshes"}

# Attempts in a row without progress, and the pauses between them, s: 60 s in all, the default time that a
# service waits for a connection that was lost without notice (``BENTRAY_UPLOAD_PATIENCE_S``).
TRIES = 9
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 15.0
# Interval between polls of an upload during ingestion, s.
FIRST_LOOK_S, LONGEST_LOOK_S = 0.05, 1.0

TUS = {"Tus-Resumable": "1.0.0"}
PIECE = {"Content-Type": "application/offset+octet-stream"}


def send_file(
    path: Path, on_progress: OnBytes | None, kind: UploadKind, resume: str | None, metadata: Mapping[str, str]
) -> Flow[httpx.Response]:
    """Upload a file; the result is the response with the record of the stored item."""
    if kind not in PLACES:
        raise InvalidInput("kind", repr(kind), " or ".join(PLACES))
    total = _size(path)
    if resume is None:
        location = yield from _begin(total, {**metadata, "kind": kind})
    else:
        location = f"/v1/uploads/{resume}"
    try:
        yield from _send(path, location, total, on_progress)
    except ClientError as error:
        error.upload = location.rpartition("/")[2]
        raise
    return (yield from _read(location))


def send_direct(
    path: Path, on_progress: OnBytes | None, kind: UploadKind, metadata: Mapping[str, str]
) -> Flow[httpx.Response]:
    """Upload a file in parts to the bucket of the service; the result is as of ``send_file``."""
    total = _size(path)
    request = {"json": {"kind": kind, "length": total, "metadata": dict(metadata)}}
    # An unused upload expires.
    upload = yield from answer(DirectUploadRecord, "POST", "/v1/direct-uploads", request, repeatable=True)
    for number in range(1, upload.parts + 1):
        # Asked for one by one, since addresses expire.
        asked = {"json": {"numbers": [number]}}
        addresses = yield from answer(PartAddresses, "POST", upload.links["parts"], asked, repeatable=True)
        piece = addresses.parts[0]
        begin = (number - 1) * upload.part_bytes
        headers = {"Content-Length": str(piece.bytes)}
        chunks = _chunks(path, begin, begin + piece.bytes, on_progress, total)
        yield RequestStep("PUT", piece.url, {"headers": headers}, chunks, repeatable=True)
    yield RequestStep("POST", upload.links["complete"], repeatable=True)
    return (yield from _read(upload.links["self"]))


def _begin(total: int, said: Mapping[str, str]) -> Flow[str]:
    metadata = ",".join(f"{name} {base64.b64encode(text.encode()).decode()}" for name, text in said.items())
    headers = {**TUS, "Upload-Length": str(total), "Upload-Metadata": metadata}
    # An unused upload expires.
    response = yield RequestStep("POST", "/v1/uploads", {"headers": headers}, repeatable=True)
    return httpx.URL(response.headers["Location"]).path


def _send(path: Path, where: str, total: int, on_progress: OnBytes | None) -> Flow[None]:
    """Send the missing data, with retries."""
    failures, reached, pause = 0, -1, FIRST_PAUSE_S
    while True:
        try:
            there = yield RequestStep("HEAD", where, {"headers": TUS}, repeatable=True)
            offset, length = int(there.headers["Upload-Offset"]), int(there.headers["Upload-Length"])
            if length != total:
                raise ClientError(f"{path} has {total} bytes, but the upload at {where} has {length}")
            if offset > reached:
                failures, reached, pause = 0, offset, FIRST_PAUSE_S
            if offset == total:
                return
            headers = {**TUS, **PIECE, "Upload-Offset": str(offset), "Content-Length": str(total - offset)}
            yield RequestStep("PATCH", where, {"headers": headers}, _chunks(path, offset, total, on_progress))
            return
        except ClientError as error:
            # Locked: the service has not yet noticed that the previous connection is broken.
            if not isinstance(error, NoAnswer) and error.status not in (408, 409, 423, 500, 502, 503, 504):
                raise
            failures += 1
            if failures == TRIES:
                raise
        yield PauseStep(pause)
        pause = min(2.0 * pause, LONGEST_PAUSE_S)


def _read(where: str) -> Flow[httpx.Response]:
    """Wait until the service has ingested the upload."""
    pause = FIRST_LOOK_S
    while True:
        record = yield from answer(UploadRecord, "GET", where, repeatable=True)
        if record.state == "done":
            result: httpx.Response = yield RequestStep("GET", record.links["result"], repeatable=True)
            return result
        if record.state == "refused":
            raise from_problem(record.problem)
        yield PauseStep(pause)
        pause = min(1.5 * pause, LONGEST_LOOK_S)


def _chunks(
    path: Path, offset: int, end: int, on_progress: OnBytes | None, total: int | None = None
) -> Callable[[], Iterator[bytes]]:
    def chunks() -> Iterator[bytes]:
        sent = offset
        try:
            with path.open("rb") as file:
                file.seek(offset)
                while sent < end and (chunk := file.read(min(CHUNK_BYTES, end - sent))):
                    yield chunk
                    sent += len(chunk)
                    if on_progress is not None:
                        on_progress(sent, end if total is None else total)
        except OSError as error:
            raise _unreadable(path, error) from error

    return chunks


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError) -> ClientError:
    return ClientError(f"{path} cannot be read: {error.strerror}")

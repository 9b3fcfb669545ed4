"""Files sent so that a broken download goes on: a tag for the content, parts of it, and a name."""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path
from typing import Any, BinaryIO

from fastapi import Request, Response
from fastapi.responses import FileResponse
from starlette.types import Receive, Scope, Send

from ..refusals import Deleted, RangeNotSatisfiable
from ..web.errors import problems

# One part; of several at once, or of a form that nobody knows, the whole file is sent, as RFC 9110 allows.
ONE_PART = re.compile(r"bytes=(\d*)-(\d*)")


def download_of(*media_types: str) -> dict[int | str, dict[str, Any]]:
    """What a route that sends a file may answer, for its OpenAPI description."""
    content = {media: {"schema": {"type": "string", "format": "binary"}} for media in media_types}
    return {
        200: {"content": content, "description": "The file."},
        206: {"content": content, "description": "The part that Range asked for."},
        304: {"description": "The file that the client has is still right."},
        **problems(416),
    }


def download(
    request: Request, path: Path, seed: str, media_type: str, name: str | None = None, tag: str | None = None
) -> Response:
    """A file, the part of it that was asked for, or 304 where the client has it.

    Args:
        request: its ``Range``, ``If-Range`` and ``If-None-Match`` count.
        path: of a file that is replaced whole or not at all.
        seed: what tells the content from all others; the tag follows from it and from the file's own age.
        media_type: of the file.
        name: that the client is to give it; None: its own.
        tag: of the content where it is known already.

    Raises:
        NoSuchPart: for a part beyond the end.
        Deleted: when there is none any more.
    """
    try:
        # From now on it is open: one that is deleted meanwhile is sent to its end.
        file = path.open("rb")
    except FileNotFoundError as error:
        raise Deleted(path.name.partition(".")[0]) from error
    answer: Response | None = None
    try:
        state = os.fstat(file.fileno())
        tag = tag or _tag_of(state, path, seed)
        if (known := unchanged(request, tag)) is not None:
            return known
        headers = headers_of(tag)
        whole = not _part_asked_for(request, tag, state.st_size)
        answer = OpenFile(file, whole, headers, media_type, name or path.name)
        return answer
    finally:
        if answer is None:
            file.close()


def tag_of(path: Path, seed: str) -> str:
    """The tag of a file, or of what is made of it alone; ``seed`` and errors as of ``download``."""
    try:
        return _tag_of(path.stat(), path, seed)
    except FileNotFoundError as error:
        raise Deleted(path.name.partition(".")[0]) from error


def file_bytes(path: Path) -> int:
    """Bytes of a file; raises Deleted when there is none any more."""
    try:
        return path.stat().st_size
    except FileNotFoundError as error:
        raise Deleted(path.name.partition(".")[0]) from error


def unchanged(request: Request, tag: str) -> Response | None:
    """The answer to a client that has it, or None."""
    known = request.headers.get("if-none-match")
    if known is not None and (tag in known or known.strip() == "*"):
        return Response(status_code=304, headers=headers_of(tag))
    return None


def headers_of(tag: str) -> dict[str, str]:
    """What each answer says of the file."""
    return {"ETag": tag, "Cache-Control": "private, no-cache"}


def _tag_of(state: os.stat_result, path: Path, seed: str) -> str:
    told = f"{seed}/{path.name}/{state.st_mtime_ns}/{state.st_size}"
    return f'"{hashlib.sha256(told.encode()).hexdigest()[:32]}"'


class OpenFile(FileResponse):
    """A file that is open, also one without a name any more; closed once it is sent."""

    def __init__(
        self, file: BinaryIO, whole: bool, headers: dict[str, str], media_type: str, name: str
    ) -> None:
        """Args:
        file: to send.
        whole: whether all of it is sent, whatever part the request names.
        headers, media_type, name: of the answer.
        """
        # Opened by this name, each answer has a place of its own in it.
        path, state = f"/proc/self/fd/{file.fileno()}", os.fstat(file.fileno())
        super().__init__(path, headers=headers, media_type=media_type, filename=name, stat_result=state)
        self._file = file
        self._whole = whole

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = [one for one in scope["headers"] if not (self._whole and one[0] == b"range")]
        with self._file:
            await super().__call__({**scope, "headers": headers}, receive, send)


def _part_asked_for(request: Request, tag: str, size: int) -> bool:
    """Whether a part is to be sent; raises NoSuchPart for one that is not there."""
    found = ONE_PART.fullmatch(request.headers.get("range", ""))
    if found is None or found.groups() == ("", ""):
        return False
    # Only the tag tells for sure that it is the same file: another one is sent whole.
    if request.headers.get("if-range", tag) != tag:
        return False
    first, last = found.groups()
    if first and last and int(last) < int(first):
        return False
    begins_inside = int(first) < size if first else int(last) > 0
    if not begins_inside:
        raise RangeNotSatisfiable(found.group(), size)
    return True

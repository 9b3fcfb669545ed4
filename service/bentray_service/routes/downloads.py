"""Resumable file downloads: ETag, Range and file name."""

import hashlib
import os
import re
from contextlib import ExitStack
from pathlib import Path
from typing import Any, BinaryIO

from fastapi import Request, Response
from fastapi.responses import FileResponse
from starlette.types import Receive, Scope, Send

from ..errors import Deleted, RangeNotSatisfiable
from ..web.errors import problems

# A single range; for several ranges or other forms the whole file is sent, as RFC 9110 allows.
ONE_PART = re.compile(r"bytes=(\d*)-(\d*)")


def download_of(*media_types: str) -> dict[int | str, dict[str, Any]]:
    """The responses of a download, for the OpenAPI description."""
    content = {media: {"schema": {"type": "string", "format": "binary"}} for media in media_types}
    return {
        200: {"content": content, "description": "The file."},
        206: {"content": content, "description": "The requested range."},
        304: {"description": "Not modified."},
        **problems(416),
    }


def download(
    request: Request, path: Path, seed: str, media_type: str, name: str | None = None, tag: str | None = None
) -> Response:
    """The response with a file, the requested range, or 304.

    Args:
        request: with ``Range``, ``If-Range`` and ``If-None-Match``.
        path: of a file that is only replaced as a whole.
        seed: identifies the content; the ETag is computed from it and the modification time.
        media_type: of the file.
        name: file name for the client; None: that of ``path``.
        tag: the ETag, if known.

    Raises:
        RangeNotSatisfiable: for a range beyond the end.
        Deleted: when the file no longer exists.
    """
    try:
        # An open file is sent completely, even if it is deleted in the meantime.
        file = path.open("rb")
    except FileNotFoundError as error:
        raise Deleted(path.name.partition(".")[0]) from error
    with ExitStack() as stack:
        stack.enter_context(file)
        state = os.fstat(file.fileno())
        tag = tag or tag_of(path, seed, state)
        if (response := unchanged(request, tag)) is not None:
            return response
        whole = not _wants_range(request, tag, state.st_size)
        response = OpenFile(file, whole, headers_of(tag), media_type, name or path.name)
        # The response closes the file.
        stack.pop_all()
        return response


def tag_of(path: Path, seed: str, state: os.stat_result | None = None) -> str:
    """The ETag of a file, or of a file generated from it; arguments and errors as of ``download``."""
    state = state or file_status(path)
    identity = f"{seed}/{path.name}/{state.st_mtime_ns}/{state.st_size}"
    return f'"{hashlib.sha256(identity.encode()).hexdigest()[:32]}"'


def file_status(path: Path) -> os.stat_result:
    """Status of a file; raises Deleted when it no longer exists."""
    try:
        return path.stat()
    except FileNotFoundError as error:
        raise Deleted(path.name.partition(".")[0]) from error


def unchanged(request: Request, tag: str) -> Response | None:
    """A 304 response if the client has the current version, else None."""
    tags = request.headers.get("if-none-match")
    # "*" matches any version.
    if tags is not None and (tag in tags or tags.strip() == "*"):
        return Response(status_code=304, headers=headers_of(tag))
    return None


def without_length(media_type: str, headers: dict[str, str]) -> Response:
    """The response to HEAD for content that has not been generated, so its length is unknown."""
    response = Response(media_type=media_type, headers=headers)
    del response.headers["content-length"]
    return response


def headers_of(tag: str) -> dict[str, str]:
    """Cache headers of a file."""
    return {"ETag": tag, "Cache-Control": "private, no-cache"}


class OpenFile(FileResponse):
    """A response with an open file, which may have been deleted; it is closed after sending."""

    def __init__(
        self, file: BinaryIO, whole: bool, headers: dict[str, str], media_type: str, name: str
    ) -> None:
        """Args:
        file: to send.
        whole: ignore the requested range.
        headers, media_type, name: of the response.
        """
        # Every open of this path has its own file position.
        path, state = f"/proc/self/fd/{file.fileno()}", os.fstat(file.fileno())
        super().__init__(path, headers=headers, media_type=media_type, filename=name, stat_result=state)
        self._file = file
        self._whole = whole

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = [header for header in scope["headers"] if not (self._whole and header[0] == b"range")]
        with self._file:
            await super().__call__({**scope, "headers": headers}, receive, send)


def _wants_range(request: Request, tag: str, size: int) -> bool:
    """Whether to send a range; raises RangeNotSatisfiable."""
    match = ONE_PART.fullmatch(request.headers.get("range", ""))
    if match is None or match.groups() == ("", ""):
        return False
    # Without a matching ETag the whole file is sent.
    if request.headers.get("if-range", tag) != tag:
        return False
    first, last = match.groups()
    if first and last and int(last) < int(first):
        return False
    begins_inside = int(first) < size if first else int(last) > 0
    if not begins_inside:
        raise RangeNotSatisfiable(match.group(), size)
    return True

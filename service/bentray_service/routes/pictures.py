"""Pictures of volumes over HTTP, each with a tag, so that none is drawn twice for one client."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, TypeVar

from fastapi import Request, Response
from starlette.requests import ClientDisconnect

from .. import __version__
from ..web.errors import problems
from ..wiring import caller_of, parts_of

Made = TypeVar("Made")

# What a route that gives a picture may answer.
PICTURE: dict[int | str, dict[str, Any]] = {
    200: {"content": {"image/png": {}}, "description": "The picture."},
    304: {"description": "The picture that the client has is still right."},
    **problems(404, 422, 429, 503),
}


async def picture(
    request: Request, volume: Mapping[str, Any], how: Mapping[str, Any], draw: Callable[[], Awaitable[bytes]]
) -> Response:
    """A PNG with its tag, or 304 where the client has it.

    Args:
        request: what is asked. HEAD is answered without drawing, so without Content-Length.
        volume: its row.
        how: all that the picture depends on beside it.
        draw: makes the picture; called where it is needed, and given up when the client leaves.
    """
    known = request.headers.get("if-none-match")
    seed = repr((__version__, volume["id"], volume["created"], sorted(how.items())))
    tag = f'"{hashlib.sha256(seed.encode()).hexdigest()[:32]}"'
    headers = {"ETag": tag, "Cache-Control": "private, no-cache"}
    # A star stands for whichever the client has.
    if known is not None and (tag in known or known.strip() == "*"):
        return Response(status_code=304, headers=headers)
    if request.method == "HEAD":
        answer = Response(media_type="image/png", headers=headers)
        # That of the empty body; the picture's is not known before it is drawn.
        del answer.headers["content-length"]
        return answer
    parts_of(request).sign_in.check_render(caller_of(request))
    return Response(await while_connected(request, draw()), media_type="image/png", headers=headers)


async def while_connected(request: Request, work: Awaitable[Made]) -> Made:
    """What the work makes; it is cancelled when the client leaves.

    Args:
        request: whose body has been read, or has none.
        work: that waits on the cluster.

    Raises:
        ClientDisconnect: when nobody is left to read the answer.
    """
    making, leaving = asyncio.ensure_future(work), asyncio.ensure_future(_left(request))
    try:
        await asyncio.wait((making, leaving), return_when=asyncio.FIRST_COMPLETED)
        if making.done():
            return making.result()
        raise ClientDisconnect
    finally:
        for one in (making, leaving):
            one.cancel()
        await asyncio.gather(making, leaving, return_exceptions=True)


async def _left(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        """The empty body of the request."""

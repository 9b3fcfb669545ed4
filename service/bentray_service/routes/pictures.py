"""Rendered PNG images with an ETag and rate limit; rendering stops when the client disconnects."""

from __future__ import annotations

import asyncio
import hashlib
import math
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, TypeVar

from fastapi import Request, Response
from starlette.requests import ClientDisconnect

from .. import __version__
from ..rows.tables import StoredRow
from ..web.errors import problems
from ..wiring import Context, RequestContext
from .downloads import headers_of, unchanged, without_length

Made = TypeVar("Made")

# Rays of a picture that counts in full in the rate limit, and what the smallest one counts.
WHOLE_RAYS = 2**18
LEAST_SHARE = 0.1

# Responses of a rendered image.
PICTURE: dict[int | str, dict[str, Any]] = {
    200: {"content": {"image/png": {}}, "description": "The picture."},
    304: {"description": "Not modified."},
    **problems(404, 422, 429, 503),
}


async def picture(
    context: RequestContext,
    item: StoredRow,
    how: Mapping[str, Any],
    draw: Callable[[], Awaitable[bytes]],
    media_type: str = "image/png",
) -> Response:
    """The response with a PNG or another result of a worker, or 304.

    Args:
        context: HEAD is answered without rendering, hence without Content-Length.
        item: what is shown.
        how: all other parameters of the image.
        draw: renders the image; cancelled when the client disconnects.
        media_type: of the image.
    """
    request = context.request
    seed = repr((__version__, item.id, item.created, sorted(how.items())))
    tag = f'"{hashlib.sha256(seed.encode()).hexdigest()[:32]}"'
    if (response := unchanged(request, tag)) is not None:
        return response
    if request.method == "HEAD":
        return without_length(media_type, headers_of(tag))
    context.check_render(_share(how))
    return Response(await while_connected(request, draw()), media_type=media_type, headers=headers_of(tag))


def _share(how: Mapping[str, Any]) -> float:
    """Weight of a picture in the rate limit; a viewer that turns an object requests many small ones."""
    times = how.get("rays", how.get("degree", 1) if how.get("supersampling") == "real" else 1)
    rays: float = (
        how.get("width", math.inf) * how.get("height", math.inf) * (times / how.get("ray_spacing", 1)) ** 2
    )
    return min(1.0, max(LEAST_SHARE, rays / WHOLE_RAYS))


async def check_render_rate(context: Context) -> None:
    """Limit the rate of what workers compute like that of rendered images."""
    context.check_render()


async def while_connected(request: Request, work: Awaitable[Made]) -> Made:
    """Await ``work``; it is cancelled when the client disconnects.

    Args:
        request: its body has been read, or is empty.
        work: on the cluster.

    Raises:
        ClientDisconnect: when the client has disconnected.
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

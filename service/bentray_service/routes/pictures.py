"""Pictures of volumes over HTTP, each with a tag, so that none is drawn twice for one client."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from typing import Any

from fastapi import Request, Response

from bentray_workers.refraction_view import check_even
from bentray_workers.scene_cache import check_size

from .. import __version__
from ..errors import described
from ..wiring import caller_of, parts_of

# What a route that gives a picture may answer.
PICTURE: dict[int | str, dict[str, Any]] = {
    200: {"content": {"image/png": {}}, "description": "The picture."},
    304: {"description": "The picture that the client has is still right."},
    **described(404, 422, 429, 503),
}


def check_renderable(volume: Mapping[str, Any]) -> None:
    """Refuse a volume that cannot be shown as glass: not in space, uneven, or too large for any worker.

    Raises:
        InvalidInput: naming ``volume``.
    """
    check_even(volume["shape"], volume["spacing_m"])
    check_size(volume["shape"])


def picture(
    request: Request, volume: Mapping[str, Any], how: Mapping[str, Any], draw: Callable[[], bytes]
) -> Response:
    """A PNG with its tag, or 304 where the client has it.

    Args:
        request: what is asked. HEAD is answered without drawing, so without Content-Length.
        volume: its row.
        how: all that the picture depends on beside it.
        draw: makes the picture; called where it is needed.
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
    parts_of(request).door.check_render(caller_of(request))
    return Response(draw(), media_type="image/png", headers=headers)

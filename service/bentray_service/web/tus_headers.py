"""Headers of tus on all responses below /v1/uploads, and the method override header."""

from __future__ import annotations

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

VERSION = "1.0.0"
PLACE = "/v1/uploads"


class TusHeaders:
    """ASGI middleware that adds the version of tus, also to errors."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or not scope["path"].startswith(PLACE):
            await self.app(scope, receive, send)
            return
        method = Headers(scope=scope).get("x-http-method-override", "").upper()
        if scope["method"] == "POST" and method in ("PATCH", "DELETE"):
            # In place, so that the outer middleware logs the actual method.
            scope["method"] = method

        async def send_with_version(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update({"Tus-Resumable": VERSION, "Tus-Version": VERSION})
            await send(message)

        await self.app(scope, receive, send_with_version)

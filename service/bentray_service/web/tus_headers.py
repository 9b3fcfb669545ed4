"""The upload protocol on every answer below /v1/uploads, and methods that a proxy does not let through."""

from __future__ import annotations

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

VERSION = "1.0.0"
PLACE = "/v1/uploads"


class TusHeaders:
    """ASGI middleware: names the version, also where a request is refused."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or not scope["path"].startswith(PLACE):
            await self.app(scope, receive, send)
            return
        wanted = Headers(scope=scope).get("x-http-method-override", "").upper()
        if scope["method"] == "POST" and wanted in ("PATCH", "DELETE"):
            # In place: who counts and records requests outside of this is to see what was done.
            scope["method"] = wanted

        async def send_with_version(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update({"Tus-Resumable": VERSION, "Tus-Version": VERSION})
            await send(message)

        await self.app(scope, receive, send_with_version)

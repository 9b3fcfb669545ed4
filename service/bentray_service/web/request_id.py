"""Request ids: from the client or generated, returned in a header and added to all log lines."""

from __future__ import annotations

import re
import secrets

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..logs import about

REQUEST_ID = "X-Request-ID"
# Excludes line breaks, which would split log lines.
_FORM = re.compile(r"[A-Za-z0-9._-]{1,64}")


class RequestIds:
    """ASGI middleware that sets ``request.state.request_id`` and the response header."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        sent = Headers(scope=scope).get(REQUEST_ID, "")
        number = sent if _FORM.fullmatch(sent) else secrets.token_hex(8)
        scope.setdefault("state", {})["request_id"] = number

        async def send_with_id(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message)[REQUEST_ID] = number
            await send(message)

        with about(request=number):
            await self.app(scope, receive, send_with_id)

"""Middleware of every response: request ids, security headers and headers of tus; the name of a route."""

import re
import secrets
from collections.abc import Mapping

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ..logs import about

SECURITY_HEADERS = {
    "Content-Security-Policy": (
        # Images requested with a key are shown from blobs.
        "default-src 'self'; img-src 'self' blob:; base-uri 'none'; form-action 'self'; "
        "frame-ancestors 'none'; object-src 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}

REQUEST_ID = "X-Request-ID"
# Excludes line breaks, which would split log lines.
_REQUEST_ID_FORM = re.compile(r"[A-Za-z0-9._-]{1,64}")

TUS_VERSION = "1.0.0"
TUS_PLACE = "/v1/uploads"


def identify(app: ASGIApp) -> ASGIApp:
    """Middleware that sets ``request.state.request_id``, and adds it and ``SECURITY_HEADERS``."""

    async def identified(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await app(scope, receive, send)
            return
        sent = Headers(scope=scope).get(REQUEST_ID, "")
        number = sent if _REQUEST_ID_FORM.fullmatch(sent) else secrets.token_hex(8)
        scope.setdefault("state", {})["request_id"] = number
        with about(request=number):
            await app(scope, receive, _adding(send, {**SECURITY_HEADERS, REQUEST_ID: number}))

    return identified


def speak_tus(app: ASGIApp) -> ASGIApp:
    """Middleware that adds the version of tus below ``TUS_PLACE``, to errors too; and overrides methods."""

    async def spoken(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["path"].startswith(TUS_PLACE):
            method = Headers(scope=scope).get("x-http-method-override", "").upper()
            if scope["method"] == "POST" and method in ("PATCH", "DELETE"):
                # In place, so that the outer middleware logs the actual method.
                scope["method"] = method
            send = _adding(send, {"Tus-Resumable": TUS_VERSION, "Tus-Version": TUS_VERSION})
        await app(scope, receive, send)

    return spoken


def _adding(send: Send, headers: Mapping[str, str]) -> Send:
    """Send a response with further headers."""

    async def adding(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(headers)
        await send(message)

    return adding


def route_of(scope: Scope) -> str:
    """The path template of the route, e.g. ``/v1/jobs/{job_id}``."""
    return str(getattr(scope.get("route"), "path", "unmatched"))

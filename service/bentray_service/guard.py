"""Middleware that authenticates, logs and counts every request, and refuses packed bodies."""

from __future__ import annotations

import logging
import time
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from bentray_kernels.errors import InvalidInput

from .access.caller import Caller
from .access.key_watch import answer_while_valid
from .errors import PackedBody
from .web.errors import problem_response
from .web.middleware import route_of
from .wiring import access_of

log = logging.getLogger("bentray.access")

# Public paths: pages without data, and health checks. All other paths need authentication.
# Sign-in and sign-out authenticate by themselves.
PUBLIC = frozenset(
    {
        "/",
        "/docs",
        "/docs/formats",
        "/documentation",
        "/openapi.json",
        "/health/live",
        "/health/ready",
        "/sign-in",
        "/sign-in/callback",
        "/sign-in/provider",
        "/sign-out",
    }
)
PUBLIC_FOLDERS = ("/static/", "/problems/", "/documentation/")


class Guard:
    """ASGI middleware: sets ``request.state.caller``, or rejects the request before its body is read."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        seen = _RequestLog(scope)
        caller = None
        scope["app"].state.metrics.in_flight.inc()
        try:
            if not _public(scope["path"]):
                caller = await run_in_threadpool(_authenticate, scope, seen)
                scope.setdefault("state", {})["caller"] = caller
            _check_codings(Headers(scope=scope))
        except InvalidInput as error:
            await problem_response(error, scope["path"])(scope, receive, seen.sending(send))
        else:
            arguments = scope, seen.receiving(receive), seen.sending(send)
            if caller is not None and caller.ends:
                await answer_while_valid(self.app, *arguments, access_of(scope).sign_in.watch, caller.ends)
            else:
                await self.app(*arguments)
        finally:
            scope["app"].state.metrics.in_flight.dec()
            seen.log_request()


def _authenticate(scope: Scope, seen: _RequestLog) -> Caller:
    sign_in = access_of(scope).sign_in
    headers, peer = Headers(scope=scope), scope.get("client")
    seen.caller = sign_in.caller(headers, peer[0] if peer else "", scope["method"])
    seen.caller = sign_in.in_project(seen.caller, headers)
    sign_in.check(seen.caller, scope["method"], scope["path"])
    return seen.caller


def _check_codings(headers: Headers) -> None:
    """Raise PackedBody for a packed body; Content-Encoding means nothing without a body."""
    chunked = "transfer-encoding" in headers
    for header, accepted in (("Content-Encoding", "identity"), ("Transfer-Encoding", "chunked")):
        given = ", ".join(headers.getlist(header))
        packed = any(one.strip().lower() not in ("", accepted) for one in given.split(","))
        if packed and (chunked or headers.get("content-length", "0") != "0"):
            whole = f"{accepted}: send the body as it is, without packing"
            raise PackedBody(header, repr(given[:80]), whole)


def _public(path: str) -> bool:
    return path in PUBLIC or path.startswith(PUBLIC_FOLDERS)


class _RequestLog:
    """Collects the log entry of a request."""

    def __init__(self, scope: Scope) -> None:
        self._scope = scope
        self._begun = time.perf_counter()
        self.caller: Caller | None = None
        self.status = 500
        self.received = self.sent = 0
        self.location = ""

    def receiving(self, receive: Receive) -> Receive:
        async def counted() -> Message:
            message = await receive()
            self.received += len(message.get("body", b""))
            return message

        return counted

    def sending(self, send: Send) -> Send:
        async def counted(message: Message) -> None:
            if message["type"] == "http.response.start":
                self.status = message["status"]
                self.location = Headers(raw=message["headers"]).get("location", "")
            self.sent += len(message.get("body", b""))
            await send(message)

        return counted

    def log_request(self) -> None:
        """Write a log line, and an entry of the audit log for an authenticated request; count it."""
        figures: dict[str, Any] = {
            "method": self._scope["method"],
            "route": route_of(self._scope),
            "status": self.status,
            "received": self.received,
            "sent": self.sent,
        }
        # Of a request that signs in or out.
        self.caller = self.caller or self._scope.get("state", {}).get("caller")
        if self.caller is not None:
            who = {"tenant": self.caller.home, "how": self.caller.how, "who": self.caller.who}
            figures |= who | ({"project": self.caller.project} if self.caller.project else {})
            number = self._scope["state"]["request_id"]
            access_of(self._scope).audit.append({"request": number, **figures, "ids": self._ids()})
        took = time.perf_counter() - self._begun
        self._scope["app"].state.metrics.observe_request(self._scope, self.status, self.received, took)
        seconds, words = round(took, 4), "%s %s %d in %.3f s"
        log.info(
            words,
            self._scope["method"],
            self._scope["path"],
            self.status,
            seconds,
            extra={"figures": {**figures, "seconds": seconds}},
        )

    def _ids(self) -> list[str]:
        """Ids in the path and in the Location of the response."""
        named = [str(value) for value in self._scope.get("path_params", {}).values()]
        made = self.location.rpartition("/")[2]
        return [one[:80] for one in (*named, made) if one]

"""Closes the connection after a response to a request whose body was not read completely.

Otherwise a client could keep the connection open by sending a byte now and then. Further data is read and
discarded for a moment: unread data makes the kernel reset the connection, and the client might not receive
    the
response.
"""

from __future__ import annotations

import asyncio
from typing import Any, cast

from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from .small_chunks import MergedChunks

# Limits for discarding data.
LINGER_S = 2.0
LINGER_BYTES = 8 * 1024 * 1024

CLOSE = (b"connection", b"close")


class UnreadBodies(MergedChunks):
    """Adds ``Connection: close`` to such a response, and closes the connection."""

    _leaving = False
    _thrown_away = 0
    _end: asyncio.TimerHandle | None = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer."""
        if self._end is not None:
            self._end.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Discard data after the response."""
        if not self._leaving:
            super().data_received(data)
            return
        self._thrown_away += len(data)
        if self._thrown_away > LINGER_BYTES:
            self.transport.abort()

    def on_headers_complete(self) -> None:
        """Let the response close through this protocol."""
        before = self.cycle
        super().on_headers_complete()
        if self.cycle is not before:
            self.cycle.transport = cast(asyncio.Transport, _Closing(self))

    def on_response_complete(self) -> None:
        """Handle the end of the last response."""
        if self._leaving:
            self.server_state.total_requests += 1
        else:
            super().on_response_complete()

    def in_progress(self) -> bool:
        """Whether a response is in progress."""
        return not self._leaving and super().in_progress()

    def leave(self) -> None:
        """Close the connection, after discarding data if the body was not read."""
        if self._leaving or self.transport.is_closing():
            return
        if not self._ignoring and not (self.cycle is not None and self.cycle.more_body):
            super().leave()
            return
        self._leaving = True
        self.flow.resume_reading()
        try:
            self.transport.write_eof()
        except OSError:
            # The client has closed its side, which is not noticed while reading is paused.
            self.transport.abort()
            return
        self._end = self.loop.call_later(LINGER_S, self.transport.abort)

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
        async def closing(scope: Any, receive: Any, send: Any) -> None:
            async def send_closing(message: Any) -> None:
                if message["type"] == "http.response.start" and cycle.more_body:
                    message = last(message)
                await send(message)

            await app(scope, receive, send_closing)

        super()._start_asgi_task(cycle, closing)


def last(message: Any) -> Any:
    """The start of a response, with ``Connection: close``."""
    headers = [one for one in message.get("headers", []) if one != CLOSE]
    return {**message, "headers": [*headers, CLOSE]}


class _Closing:
    """The transport for a response."""

    def __init__(self, protocol: UnreadBodies) -> None:
        self._protocol = protocol
        self.write = protocol.transport.write
        self.is_closing = protocol.transport.is_closing
        self.close = protocol.leave

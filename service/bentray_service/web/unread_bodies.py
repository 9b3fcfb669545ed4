"""After an answer to a request whose body was not read to its end, the connection is closed.

It would otherwise live for as long as the client sends a byte of that body now and then. What still comes is
read for a moment and thrown away: data that nobody has read makes the kernel reset the connection, and the
client might not see the answer.
"""

from __future__ import annotations

import asyncio
from typing import Any, cast

from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from .small_chunks import MergedChunks

# How long and how much is thrown away at most.
LINGER_S = 2.0
LINGER_BYTES = 8 * 1024 * 1024

CLOSE = (b"connection", b"close")


class UnreadBodies(MergedChunks):
    """Says ``Connection: close`` in such an answer, and does it."""

    _leaving = False
    _thrown_away = 0
    _end: asyncio.TimerHandle | None = None

    def connection_lost(self, exc: Exception | None) -> None:
        """It is gone."""
        if self._end is not None:
            self._end.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Once the answer is given, nothing that comes matters."""
        if not self._leaving:
            super().data_received(data)
            return
        self._thrown_away += len(data)
        if self._thrown_away > LINGER_BYTES:
            self.transport.abort()

    def on_headers_complete(self) -> None:
        """The answer closes by way of us."""
        before = self.cycle
        super().on_headers_complete()
        if self.cycle is not before:
            self.cycle.transport = cast(asyncio.Transport, _Closing(self))

    def on_response_complete(self) -> None:
        """There is no next request where this was the last."""
        if self._leaving:
            self.server_state.total_requests += 1
        else:
            super().on_response_complete()

    def answering(self) -> bool:
        """What was answered is left to its end."""
        return not self._leaving and super().answering()

    def leave(self) -> None:
        """Close, at once where nothing of a request is left to come."""
        if self._leaving or self.transport.is_closing():
            return
        if not self._deaf and not (self.cycle is not None and self.cycle.more_body):
            super().leave()
            return
        self._leaving = True
        self.flow.resume_reading()
        try:
            self.transport.write_eof()
        except OSError:
            # The client has closed its end, which nobody sees while reading is paused.
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
    """The same beginning of an answer, which says that it is the last one of its connection."""
    headers = [one for one in message.get("headers", []) if one != CLOSE]
    return {**message, "headers": [*headers, CLOSE]}


class _Closing:
    """The transport as an answer sees it."""

    def __init__(self, protocol: UnreadBodies) -> None:
        self._protocol = protocol
        self.write = protocol.transport.write
        self.is_closing = protocol.transport.is_closing
        self.close = protocol.leave

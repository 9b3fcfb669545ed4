"""Merging of small body chunks, and a limit on their number."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.flow_control import HIGH_WATER_LIMIT
from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from bentray_kernels.errors import InvalidInput

from ..errors import TinyChunks
from .slow_headers import HeaderTimeout

# The application is woken after this many bytes, or after this time.
ENOUGH_BYTES = 16 * 1024
LATEST_S = 0.02
# After this many chunks, the mean chunk size must not be smaller than this. Parsing of each chunk
# blocks other requests for about a microsecond.
FREE_CHUNKS = 1024
MIN_MEAN_BYTES = 512


class MergedChunks(HeaderTimeout):
    """Passes bodies to the application in large pieces; rejects bodies with too many small chunks."""

    _chunked = False
    _chunks = _came = 0
    # Error of the last body.
    _broken: InvalidInput | None = None
    _timer: asyncio.TimerHandle | None = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer."""
        self._stop_timer()
        super().connection_lost(exc)

    def on_headers_complete(self) -> None:
        """Prepare for a body."""
        super().on_headers_complete()
        self._chunked = any(name == b"transfer-encoding" for name, _ in self.headers)
        self._chunks = self._came = 0

    def on_body(self, body: bytes) -> None:
        """A part of the body was received."""
        cycle = self.cycle
        if cycle.response_complete:
            return
        self._chunks += 1
        self._came += len(body)
        few = self._chunks <= FREE_CHUNKS or self._came >= MIN_MEAN_BYTES * self._chunks
        if self._chunked and not few:
            found = f"{self._chunks} chunks of {self._came / self._chunks:.0f} bytes on average"
            accepted = f"at least {MIN_MEAN_BYTES} bytes on average, or a Content-Length instead of chunks"
            raise TinyChunks("body", found, accepted)
        cycle.body += body
        if len(cycle.body) > HIGH_WATER_LIMIT:
            self.flow.pause_reading()
        if len(cycle.body) >= ENOUGH_BYTES:
            self._notify(cycle)
        elif self._timer is None:
            self._timer = self.loop.call_later(LATEST_S, self._notify, cycle)

    def on_message_complete(self) -> None:
        """The body was received completely."""
        self._stop_timer()
        super().on_message_complete()

    def refuse(self, error: InvalidInput) -> None:
        """Raise the error in the application if it reads the body, else send it."""
        if not self.in_progress() or not self.cycle.more_body:
            super().refuse(error)
        elif self.cycle.response_started:
            self.transport.abort()
        else:
            self._ignoring, self._broken = True, error
            self._notify(self.cycle)

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
        async def receiving(scope: Any, receive: Any, send: Any) -> None:
            async def receive_checked() -> Any:
                message = await receive()
                if self._broken is None or cycle is not self.cycle or not cycle.more_body:
                    return message
                if not cycle.response_started:
                    raise self._broken
                self.transport.abort()
                return {"type": "http.disconnect"}

            await app(scope, receive_checked, send)

        super()._start_asgi_task(cycle, receiving)

    def _notify(self, cycle: RequestResponseCycle) -> None:
        self._stop_timer()
        cycle.message_event.set()

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

"""Bodies in tiny chunks: put together for the application, and refused where there are too many."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.flow_control import HIGH_WATER_LIMIT
from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from bentray_kernels.errors import InvalidInput

from ..refusals import TinyChunks
from .slow_headers import HeaderTimeout

# What the application is woken for at once, bytes; for less, after so many seconds.
ENOUGH_BYTES = 16 * 1024
LATEST_S = 0.02
# So many chunks of a body may be of any size; of more, the mean may not be below so many bytes. Each one is
# work for the parser, a microsecond, in which nobody else is served.
FREE_CHUNKS = 1024
LEAST_MEAN_BYTES = 512


class MergedChunks(HeaderTimeout):
    """Hands bodies to the application in large pieces, and a refusal in place of one that is not worth it."""

    _chunked = False
    _chunks = _came = 0
    # What was wrong with the body that came last.
    _broken: InvalidInput | None = None
    _telling: asyncio.TimerHandle | None = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Nobody is woken any more."""
        self._tell_later_no_more()
        super().connection_lost(exc)

    def on_headers_complete(self) -> None:
        """A body may begin."""
        super().on_headers_complete()
        self._chunked = any(name == b"transfer-encoding" for name, _ in self.headers)
        self._chunks = self._came = 0

    def on_body(self, body: bytes) -> None:
        """A part of it came; of one in chunks, a chunk or less."""
        cycle = self.cycle
        if cycle.response_complete:
            return
        self._chunks += 1
        self._came += len(body)
        few = self._chunks <= FREE_CHUNKS or self._came >= LEAST_MEAN_BYTES * self._chunks
        if self._chunked and not few:
            found = f"{self._chunks} chunks of {self._came / self._chunks:.0f} bytes on average"
            accepted = f"{LEAST_MEAN_BYTES} bytes or more on average, or a Content-Length in place of chunks"
            raise TinyChunks("body", found, accepted)
        cycle.body += body
        if len(cycle.body) > HIGH_WATER_LIMIT:
            self.flow.pause_reading()
        if len(cycle.body) >= ENOUGH_BYTES:
            self._tell(cycle)
        elif self._telling is None:
            self._telling = self.loop.call_later(LATEST_S, self._tell, cycle)

    def on_message_complete(self) -> None:
        """All of it came."""
        self._tell_later_no_more()
        super().on_message_complete()

    def refuse(self, error: InvalidInput) -> None:
        """Whoever reads a body that cannot be read on is told; else as ever."""
        if not self.answering() or not self.cycle.more_body:
            super().refuse(error)
        elif self.cycle.response_started:
            self.transport.abort()
        else:
            self._deaf, self._broken = True, error
            self._tell(self.cycle)

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
        async def told(scope: Any, receive: Any, send: Any) -> None:
            async def receive_or_refuse() -> Any:
                message = await receive()
                if self._broken is None or cycle is not self.cycle or not cycle.more_body:
                    return message
                if not cycle.response_started:
                    raise self._broken
                self.transport.abort()
                return {"type": "http.disconnect"}

            await app(scope, receive_or_refuse, send)

        super()._start_asgi_task(cycle, told)

    def _tell(self, cycle: RequestResponseCycle) -> None:
        self._tell_later_no_more()
        cycle.message_event.set()

    def _tell_later_no_more(self) -> None:
        if self._telling is not None:
            self._telling.cancel()
            self._telling = None

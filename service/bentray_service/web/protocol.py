"""The HTTP protocol of one connection, counted against the limits, with a time limit for slow readers."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from ..errors import TooManyConnections
from .connections import Connections
from .errors import problem_response
from .unread_bodies import UnreadBodies, last

# Time in which a client must read this many bytes of a response, or its rest, s.
ANSWER_S = 60.0
MIN_BYTES = 64 * 1024

SHORT = ("/health/live", "/health/ready")
JOB = "/v1/jobs/job-"


class CountedProtocol(UnreadBodies):
    """A connection that is counted."""

    _spare = False
    _stuck: asyncio.TimerHandle | None = None

    def __init__(self, connections: Connections, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._counted = connections

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Count the connection."""
        super().connection_made(transport)
        self._spare = self._counted.add(self, self.client[0] if self.client else "")

    def connection_lost(self, exc: Exception | None) -> None:
        """Remove the connection."""
        self._counted.remove(self)
        self.resume_writing()
        super().connection_lost(exc)

    def drop(self) -> None:
        """Close the connection to make room for another."""
        self.transport.abort()

    def on_response_complete(self) -> None:
        """Mark the connection as idle, unless another request is waiting."""
        super().on_response_complete()
        if not self.in_progress():
            self._counted.idle(self)

    def pause_writing(self) -> None:
        """The client reads more slowly than the response is produced."""
        super().pause_writing()
        self._stuck = self.loop.call_later(ANSWER_S, self._check_progress, self._left())

    def resume_writing(self) -> None:
        """The client has read the response so far."""
        if self._stuck is not None:
            self._stuck.cancel()
            self._stuck = None
        super().resume_writing()

    def _left(self) -> int:
        return self.transport.get_write_buffer_size()

    def _check_progress(self, before: int) -> None:
        left = self._left()
        if before - left < MIN_BYTES:
            self.transport.abort()
        else:
            self._stuck = self.loop.call_later(ANSWER_S, self._check_progress, left)

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
        self._counted.busy(self)
        super()._start_asgi_task(cycle, self._limit_bodies(app) if self._spare else app)

    def _limit_bodies(self, app: Any) -> Any:
        most = self._counted.limits

        async def answer(scope: Any, receive: Any, send: Any) -> None:
            async def send_last(message: Any) -> None:
                if message["type"] == "http.response.start":
                    message = last(message)
                await send(message)

            if _short(scope["method"], scope["path"]):
                await app(scope, receive, send_last)
                return
            found = f"more than {most.of_address} from your address, or {most.most} in total"
            error = TooManyConnections("connections", found, "fewer, reused connections; see Retry-After")
            await problem_response(error, scope["path"])(scope, receive, send_last)

        return answer


def _short(method: str, path: str) -> bool:
    """Whether a request is answered at once: health checks and job records."""
    return method == "GET" and (path in SHORT or (path.startswith(JOB) and "/" not in path[len(JOB) :]))

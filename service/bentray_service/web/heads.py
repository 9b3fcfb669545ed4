"""Connections whose request does not begin are closed: what has no head yet has no caller and no limit."""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

# Within it the whole head of a request must be there.
HEAD_S = 10.0


class HeadInTime(H11Protocol):
    """HTTP/1.1 as Uvicorn speaks it, with a time within which each head of a request must come."""

    _due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first request."""
        super().connection_made(transport)
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        if self._due is not None:
            self._due.cancel()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Begin to wait for the next request."""
        super().on_response_complete()
        self._wait()

    def _wait(self) -> None:
        if self._due is not None:
            self._due.cancel()
        self._due = self.loop.call_later(HEAD_S, self._close_if_still_waiting)

    def _close_if_still_waiting(self) -> None:
        # With the last line of a head the client's side leaves this state.
        if self.conn.their_state is h11.IDLE and not self.transport.is_closing():
            self.transport.close()

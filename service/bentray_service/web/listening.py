"""The listening socket; it handles a lack of file descriptors without blocking or flooding the log."""

from __future__ import annotations

import errno
import logging
import os
import socket
from contextlib import suppress
from typing import Any

log = logging.getLogger("bentray.connections")

EXHAUSTED = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
# Number of connections accepted in a row.
AT_ONCE = 64


class Listening(socket.socket):
    """Accepts connections, and closes them at once when there is no file descriptor left.

    asyncio would keep them in the queue, retry two thousand times a second, and log each attempt.
    """

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        # Connections inherit it. asyncio sets it only where the protocol of the socket is named; without it
        # an answer in two segments waits 40 ms for an acknowledgement.
        if self.family in (socket.AF_INET, socket.AF_INET6):
            self.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._kept: int | None = os.open(os.devnull, os.O_RDONLY)
        self._taken = 0

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept the next connection.

        Raises:
            BlockingIOError: when there is none, or other work comes first.
        """
        self._taken += 1
        if self._taken > AT_ONCE:
            self._taken = 0
            raise BlockingIOError
        try:
            return super().accept()
        except BlockingIOError:
            self._taken = 0
            raise
        except OSError as error:
            if error.errno not in EXHAUSTED:
                raise
            log.error("cannot accept connections (%s)", error.strerror)
            self._reject_connection()
            raise BlockingIOError from error

    def close(self) -> None:
        """Stop listening."""
        self._close_spare()
        super().close()

    def _reject_connection(self) -> None:
        """Use the spare file descriptor to accept and close one connection."""
        self._close_spare()
        # The client may have left, or another thread may have used the descriptor.
        with suppress(OSError):
            super().accept()[0].close()
        try:
            self._kept = os.open(os.devnull, os.O_RDONLY)
        except OSError:
            self._kept = None

    def _close_spare(self) -> None:
        if self._kept is not None:
            os.close(self._kept)
            self._kept = None

"""The socket on which the service listens: a want of descriptors neither blocks it nor floods the log."""

from __future__ import annotations

import errno
import logging
import os
import socket
from contextlib import suppress
from typing import Any

log = logging.getLogger("bentray.connections")

EXHAUSTED = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM})
# Connections that are taken in before others are served again.
AT_ONCE = 64


class Listening(socket.socket):
    """Takes a connection in at any time, and closes it at once where no descriptor is left for it.

    asyncio would leave it in the queue, try again two thousand times a second, and log each.
    """

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._kept: int | None = os.open(os.devnull, os.O_RDONLY)
        self._taken = 0

    def accept(self) -> tuple[socket.socket, Any]:
        """The next connection.

        Raises:
            BlockingIOError: where there is none, or others are to be served first.
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
            log.error("no connection can be taken in (%s)", error.strerror)
            self._turn_away()
            raise BlockingIOError from error

    def close(self) -> None:
        """Listen no more."""
        self._give_up_kept()
        super().close()

    def _turn_away(self) -> None:
        """Use the descriptor that is kept for this to take one connection in, and close it."""
        self._give_up_kept()
        # Nobody may be left who waits, or another thread was faster with the descriptor.
        with suppress(OSError):
            super().accept()[0].close()
        try:
            self._kept = os.open(os.devnull, os.O_RDONLY)
        except OSError:
            self._kept = None

    def _give_up_kept(self) -> None:
        if self._kept is not None:
            os.close(self._kept)
            self._kept = None

"""The server shuts down in bounded time whatever its requests do."""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import Any

import pytest

from bentray_service.web import server

from .speaking import connected, served


def test_endless_upload_does_not_block_shutdown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(server, "PATIENCE_S", 1)
    begun = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        while True:
            begun.append(await receive())

    # Its end waits for the thread of the server, and fails where that goes on.
    with ExitStack() as open_connection, served(app) as running:
        connection = open_connection.enter_context(connected(running))
        connection.sendall(b"POST / HTTP/1.1\r\nHost: here\r\nContent-Length: 1000000\r\n\r\nx")
        deadline = time.monotonic() + 60.0
        while not begun:
            assert time.monotonic() < deadline
            time.sleep(0.01)

"""A server with the protocol of the service around any application, and raw connections to it."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import uvicorn

from bentray_service.settings import ServiceSettings
from bentray_service.web.connections import ConnectionLimits
from bentray_service.web.listening import Listening
from bentray_service.web.server import Server

PATIENCE_S = 60.0


@contextmanager
def served(app: Any, limits: ConnectionLimits | None = None, **settings: Any) -> Iterator[Server]:
    """A server of ``app``, which knows nothing of a lifespan; its port is ``server.port``."""
    with Listening() as listening:
        listening.bind(("127.0.0.1", 0))
        server = Server(app, ServiceSettings(**settings))
        server.config.lifespan = "off"
        if limits is not None:
            # Before it starts, which takes them from the descriptors in use.
            server._limits = lambda in_use: limits  # type: ignore[method-assign]
        server.port = listening.getsockname()[1]  # type: ignore[attr-defined]
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        deadline = time.monotonic() + PATIENCE_S
        while not server.started:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        try:
            yield server
        finally:
            server.should_exit = True
            thread.join(PATIENCE_S)
            assert not thread.is_alive()


def connected(server: uvicorn.Server) -> socket.socket:
    """A connection to it."""
    return socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE_S)  # type: ignore[attr-defined]


def read_to_end(connection: socket.socket) -> bytes:
    """All that comes until the server closes; fails where it does not within the patience."""
    text = b""
    while data := connection.recv(65536):
        text += data
    return text


def read_answer(connection: socket.socket) -> tuple[int, bytes]:
    """Status and body of one answer with a Content-Length."""
    text = b""
    while b"\r\n\r\n" not in text:
        data = connection.recv(65536)
        assert data, text
        text += data
    head, _, body = text.partition(b"\r\n\r\n")
    length = int(
        next(line for line in head.lower().split(b"\r\n") if line.startswith(b"content-length"))[15:]
    )
    while len(body) < length:
        data = connection.recv(65536)
        assert data
        body += data
    return int(head.split()[1]), body

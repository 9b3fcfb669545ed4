"""Slow clients: connections that send one byte per second of a large body, in one thread."""

import contextlib
import socket
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from urllib.parse import urlsplit

ANNOUNCED_BYTES = 10**6


@contextmanager
def dripping(url: str, requests: list[tuple[str, str, Mapping[str, str]]]) -> Iterator[None]:
    """Hold one connection for each ``(method, path, headers)``, each sending a byte a second."""
    address, stop = urlsplit(url), threading.Event()
    with contextlib.ExitStack() as stack:
        connections = []
        for method, path, headers in requests:
            connection = stack.enter_context(socket.create_connection((address.hostname, address.port)))
            lines = {"Host": address.netloc, "Content-Length": str(ANNOUNCED_BYTES), **headers}
            head = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
            connection.sendall(f"{method} {path} HTTP/1.1\r\n{head}\r\n".encode())
            connections.append(connection)

        def drip() -> None:
            while not stop.wait(1.0):
                for connection in connections:
                    with contextlib.suppress(OSError):
                        connection.sendall(b"x")

        thread = threading.Thread(target=drip)
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()

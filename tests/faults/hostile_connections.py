"""Hostile connections from an address of their own: idle, slow or oversize."""

import socket
import time
from contextlib import ExitStack, suppress

from .ledger import Ledger

# Connections are limited per address; this one is another than that of honest clients.
FROM = "127.0.0.66"
PATIENCE_S = 30.0
FORGED = b"bentray_forged"
NO_HTTP = (b"\x16\x03\x01\x02\x00\x01\x00\xff\r\n\r\n", b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 20_000)


class HostileConnections:
    """Ways to hold a service up without a library that speaks HTTP.

    Args:
        port: of 127.0.0.1.
        key: of a tenant.
        most: connections that one address may have.
    """

    def __init__(self, ledger: Ledger, port: int, key: str, most: int) -> None:
        self._ledger = ledger
        self._port = port
        self._key = key.encode()
        self._most = most

    def idle(self) -> None:
        """Open connections below the limit, up to it and beyond, and ask nothing."""
        for count in (self._most // 2, self._most, self._most + 50):
            with ExitStack() as open_ones:
                for _ in range(count):
                    with suppress(OSError):
                        open_ones.enter_context(self._connected())
                time.sleep(1.0)

    def slow_heads(self) -> None:
        """Thirty heads, each a byte at a time, which never end."""
        with ExitStack() as open_ones:
            own = [open_ones.enter_context(self._connected()) for _ in range(30)]
            for byte in b"GET /v1/datasets HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ":
                for held in own:
                    with suppress(OSError):
                        held.sendall(bytes([byte]))
                time.sleep(0.05)

    def tiny_chunks(self) -> None:
        """A body in chunks of a byte, as fast as they go."""
        with self._connected() as single:
            single.sendall(self._head("POST", "/v1/datasets", "Transfer-Encoding: chunked"))
            with suppress(OSError):
                for _ in range(200):
                    single.sendall(b"1\r\nx\r\n" * 1000)
            self._note(single, "tiny chunks")

    def bodies_that_never_come(self) -> None:
        """Ten large bodies that are declared, and hardly begun."""
        with ExitStack() as open_ones:
            for path in 5 * ("/v1/datasets", "/v1/volumes?spacing_m=0.001"):
                single = open_ones.enter_context(self._connected())
                single.sendall(self._head("POST", path, f"Content-Length: {2 * 10**9}") + bytes(100))
            time.sleep(2.0)

    def forged(self) -> None:
        """A body under a key that is none: refused before it comes."""
        with self._connected() as single:
            head = self._head("POST", "/v1/datasets", "Content-Length: 1000000").replace(self._key, FORGED)
            single.sendall(head)
            self._note(single, "a forged key")

    def no_http(self) -> None:
        """Bytes that are not HTTP, and heads beyond every limit."""
        for words in NO_HTTP:
            with self._connected() as single:
                with suppress(OSError):
                    single.sendall(words)
                self._note(single, "no HTTP")

    def gone(self, path: str) -> None:
        """Ask for something, and leave."""
        with self._connected() as single:
            single.sendall(self._head("GET", path))
            time.sleep(0.2)

    def _connected(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self._port), PATIENCE_S, (FROM, 0))

    def _head(self, method: str, path: str, *more: str) -> bytes:
        lines = [f"{method} {path} HTTP/1.1", "Host: 127.0.0.1", *more]
        own = b"Authorization: Bearer " + self._key
        return "\r\n".join(lines).encode() + b"\r\n" + own + b"\r\n\r\n"

    def _note(self, connection: socket.socket, what: str) -> None:
        """Take down the status that comes; a connection may also be closed without a word."""
        with suppress(OSError):
            words = connection.recv(4096).split(b" ", 2)
            if len(words) == 3 and words[0].startswith(b"HTTP/"):
                status = int(words[1])
                self._ledger.count("nobody", what, status)
                if not 400 <= status < 500 and status != 503:
                    self._ledger.fault(f"{what}: {status}")

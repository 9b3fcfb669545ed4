"""A proxy on loopback that breaks connections off after so many bytes, as a bad line does."""

import contextlib
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit


class CuttingProxy:
    """Passes bytes on to ``url``; each number in ``cuts`` ends the connection that brings so many in all.

    Attributes:
        url: its own address.
        made: how many connections it was asked for.
    """

    def __init__(self, url: str, cuts: list[int]) -> None:
        self._target = urlsplit(url).hostname, urlsplit(url).port
        self._cuts = cuts
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listening.getsockname()[1]}"
        self._sent = self.made = 0
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._listening.close()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listening.accept()
            except OSError:
                return
            self.made += 1
            server = socket.create_connection(self._target)
            threading.Thread(target=self._answers, args=(server, client), daemon=True).start()
            threading.Thread(target=self._requests, args=(client, server), daemon=True).start()

    def _requests(self, client: socket.socket, server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := client.recv(65536):
                server.sendall(data)
                self._sent += len(data)
                if self._cuts and self._sent >= self._cuts[0]:
                    self._cuts.pop(0)
                    break
        # The service gets all that was passed on; the client is reset.
        with contextlib.suppress(OSError):
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            server.shutdown(socket.SHUT_WR)
        client.close()

    def _answers(self, server: socket.socket, client: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := server.recv(65536):
                client.sendall(data)
        server.close()


@contextmanager
def cutting(url: str, cuts: list[int]) -> Iterator[CuttingProxy]:
    proxy = CuttingProxy(url, cuts)
    try:
        yield proxy
    finally:
        proxy.close()

"""A receiver of webhooks on loopback that answers as a test wants."""

import ssl
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import chain, repeat

from ...waiting import wait_until

Message = tuple[dict[str, str], bytes]


class Receiver:
    """Keeps the messages that it gets.

    Attributes:
        messages: headers, with small letters, and body of each request.
        answers: statuses of the next requests; 200 when there are none left.
        location: of redirects.
        hold: while it is clear, requests wait before they are answered.
        raw: sent in place of an answer, with pauses; the last piece for ever, None closes the connection.
        pause_s: between them.
    """

    def __init__(self, tls: ssl.SSLContext | None = None) -> None:
        self.messages: list[Message] = []
        self.answers: list[int] = []
        self.location = ""
        self.raw: list[bytes | None] = []
        self.pause_s = 0.0
        self.hold = threading.Event()
        self.hold.set()
        receiver = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                receiver.messages.append(({k.lower(): v for k, v in self.headers.items()}, body))
                receiver.hold.wait(60.0)
                for piece in chain(receiver.raw, repeat(receiver.raw[-1]) if receiver.raw else ()):
                    if piece is None:
                        self.close_connection = True
                        return
                    self.wfile.write(piece)
                    time.sleep(receiver.pause_s)
                self.send_response(receiver.answers.pop(0) if receiver.answers else 200)
                if receiver.location:
                    self.send_header("Location", receiver.location)
                self.end_headers()

            do_GET = do_POST

            def log_message(self, *_: object) -> None:
                """Nothing is printed."""

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.handle_error = lambda *_: None  # type: ignore[method-assign]
        scheme = "http"
        if tls is not None:
            scheme = "https"
            self._server.socket = tls.wrap_socket(self._server.socket, server_side=True)
        self.port = self._server.server_port
        self.url = f"{scheme}://127.0.0.1:{self.port}/hook?token=t"
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    def close(self) -> None:
        self.hold.set()
        self._server.shutdown()
        self._server.server_close()

    def wait(self, count: int) -> None:
        """Wait until there are this many messages."""
        self.until(lambda: len(self.messages) >= count)

    @staticmethod
    def until(condition: Callable[[], object], patience_s: float = 60.0) -> None:
        wait_until(condition, patience_s)

"""An S3 server of a test's own on loopback: moto's, behind a switch that lets it fail."""

import logging
import secrets
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

import httpx
import pytest
from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import make_server

SECRET = "a-secret-that-no-log-shows"


class Server:
    """Keeps buckets in memory.

    Attributes:
        away: set it, and every request is answered with 503.
        silent: set it, and none is answered before it is cleared.
        asked: method and path of every request.
        port: of 127.0.0.1.
    """

    def __init__(self) -> None:
        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        self.away, self.silent = threading.Event(), threading.Event()
        self.asked: list[tuple[str, str]] = []
        self._moto = DomainDispatcherApplication(create_backend_app)
        self._server = make_server("127.0.0.1", 0, self._answer, threaded=True)
        self.port = int(self._server.server_port)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def new_bucket(self, monkeypatch: pytest.MonkeyPatch) -> str:
        """The address of an empty bucket; the environment leads there for the rest of the test."""
        for name in ("AWS_PROFILE", "AWS_SESSION_TOKEN", "AWS_ENDPOINT_URL_S3"):
            monkeypatch.delenv(name, raising=False)
        for name in ("AWS_CONFIG_FILE", "AWS_SHARED_CREDENTIALS_FILE"):
            monkeypatch.setenv(name, "/dev/null")
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{self.port}")
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", SECRET)
        monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        self.away.clear()
        name = f"test-{secrets.token_hex(6)}"
        httpx.put(f"http://127.0.0.1:{self.port}/{name}").raise_for_status()
        return f"s3://{name}/scans"

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def _answer(self, environ: dict[str, Any], start: Callable[..., Any]) -> Iterable[bytes]:
        self.asked.append((environ["REQUEST_METHOD"], environ["PATH_INFO"]))
        while self.silent.is_set():
            time.sleep(0.02)
        if self.away.is_set():
            start("503 Service Unavailable", [])
            return [b""]
        answer: Iterable[bytes] = self._moto(environ, start)
        return answer

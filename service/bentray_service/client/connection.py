"""Common options of both clients."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypedDict

import httpx

from bentray_kernels.errors import InvalidInput

from .retries import PATIENCE_S, Retries

CONNECT_S = 10.0


class ConnectionOptions(TypedDict, total=False):
    """Keyword arguments of both clients, see ``Connection``."""

    timeout_s: float
    poll_s: float
    patience_s: float
    on_wait: Callable[[str], None] | None
    project: str | None


class Connection:
    """A connection to one service, to be used as a context manager.

    Every method raises :class:`ClientError` when the service rejects the request or does not answer.

    Args:
        url: of the service.
        key: API key, if required; default: the variable ``BENTRAY_KEY``.
        project: id of the project in which to work; default: the variable ``BENTRAY_PROJECT``.
        timeout_s: time limit for a response.
        poll_s: interval between polls of a job without event stream.
        patience_s: time for which requests are retried while the service is unavailable, e.g. during a
            restart. Only idempotent requests are retried: reading, downloading, uploading, and starting a job
            with a key.
            0: no retries.
        on_wait: called with a message when retries begin and when they end.

    Raises:
        InvalidInput: for an invalid ``url``.
    """

    def __init__(
        self,
        url: str,
        key: str | None = None,
        *,
        project: str | None = None,
        timeout_s: float = 300.0,
        poll_s: float = 0.3,
        patience_s: float = PATIENCE_S,
        on_wait: Callable[[str], None] | None = None,
    ) -> None:
        try:
            parsed = httpx.URL(url)
        except httpx.InvalidURL:
            parsed = httpx.URL()
        if parsed.scheme not in ("http", "https") or not parsed.host:
            raise InvalidInput("url", repr(url), "a web address, such as http://127.0.0.1:8000")
        self.url = url.rstrip("/")
        self.poll_s = poll_s
        self._retries = Retries(patience_s, on_wait)
        key = key or os.environ.get("BENTRAY_KEY")
        headers = {
            "Authorization": f"Bearer {key}" if key else None,
            "Bentray-Project": project or os.environ.get("BENTRAY_PROJECT"),
        }
        self._options: dict[str, Any] = {
            "base_url": self.url,
            "headers": {name: value for name, value in headers.items() if value},
            # An upload is answered after the service has read the file.
            "timeout": httpx.Timeout(timeout_s, connect=CONNECT_S),
        }

    def __repr__(self) -> str:
        return f"<bentray.{type(self).__name__} of {self.url}>"

"""What both clients have in common: address, key, patience, and how a flow becomes a method."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from functools import update_wrapper
from typing import Any

import httpx

from bentray_kernels.errors import InvalidInput

from .patience import PATIENCE_S, Retries

CONNECT_S = 10.0


class Connection:
    """A connection to one service; use it as a context manager.

    Every method raises :class:`ClientError` when the service refuses or does not answer.

    Args:
        url: of the service.
        key: an API key, where the service asks for one; ``BENTRAY_KEY`` without it.
        timeout_s: how long an answer may take.
        poll_s: how often a job is polled where its events do not come through.
        patience_s: how long to repeat requests to a service that has answered before and is away now, as when
            it or its database is restarted. Only what is safe to repeat is repeated: reading, downloading,
            uploading, and starting a job, which has a key of its own. 0 gives up at once.
        on_wait: called with a line when such waiting begins and when it is over.

    Raises:
        InvalidInput: for a ``url`` that is no web address.
    """

    def __init__(
        self,
        url: str,
        *,
        key: str | None = None,
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
        self._patience = Retries(patience_s, on_wait)
        key = key or os.environ.get("BENTRAY_KEY")
        self._options: dict[str, Any] = {
            "base_url": self.url,
            "headers": {"Authorization": f"Bearer {key}"} if key else {},
            # The answer to an upload comes after the service has read the whole file.
            "timeout": httpx.Timeout(timeout_s, connect=CONNECT_S),
        }


def document(method: Callable[..., Any], flow: Callable[..., Any]) -> None:
    """Give a method the name, docstring and signature of its flow, with the result in place of the flow."""
    update_wrapper(method, flow)
    signature = inspect.signature(flow)
    first, *others = signature.parameters.values()
    result = str(signature.return_annotation).removeprefix("Flow[").removesuffix("]")
    parameters = [first.replace(name="self", annotation=first.empty, kind=others[0].kind), *others]
    found = signature.replace(parameters=parameters, return_annotation=result)
    method.__signature__ = found  # type: ignore[attr-defined]

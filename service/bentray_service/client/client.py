"""The synchronous client: upload a scan, run a job, download the result."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Self, TypeVar

import httpx
from tenacity import Retrying

from ..web.outbound import Transport
from .connection import Connection, saving
from .errors import ClientError, from_response, no_answer
from .operations import Operations
from .steps import CHUNK_BYTES, DownloadStep, EventStep, Flow, PauseStep, RequestStep, Step

T = TypeVar("T")


class Client(Operations):
    __doc__ = Connection.__doc__

    def _open(self) -> None:
        self._http = httpx.Client(**self._options, transport=Transport(retries=2))
        self._bucket = httpx.Client(timeout=self._options["timeout"], transport=Transport())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()
        self._bucket.close()

    def _run(self, flow: Flow[T]) -> T:
        advance: Callable[[Any], Step] = flow.send
        outcome: Any = None
        with ExitStack() as streams:
            listening: dict[str, Iterator[str]] = {}
            while True:
                try:
                    step = advance(outcome)
                except StopIteration as end:
                    return end.value  # type: ignore[no-any-return]
                try:
                    retrying = Retrying(sleep=time.sleep, **self._retries.options(step))
                    advance, outcome = flow.send, retrying(self._do, step, streams, listening)
                except ClientError as error:
                    advance, outcome = flow.throw, error

    def _do(self, step: Step, streams: ExitStack, listening: dict[str, Iterator[str]]) -> Any:
        if isinstance(step, PauseStep):
            return time.sleep(step.seconds)
        if isinstance(step, RequestStep):
            content = None if step.body is None else step.body()
            with self._respond(step.method, step.path, content=content, **step.options) as response:
                response.read()
                return response
        if isinstance(step, DownloadStep):
            with self._respond("GET", step.path, **step.options) as response, saving(step, response) as save:
                for chunk in response.iter_bytes(CHUNK_BYTES):
                    save(chunk)
            return None
        return self._listen(step, streams, listening)

    def _listen(self, step: EventStep, streams: ExitStack, listening: dict[str, Iterator[str]]) -> str | None:
        if step.path not in listening:
            response = streams.enter_context(self._respond("GET", step.path, timeout=step.seconds))
            listening[step.path] = response.iter_lines()
        try:
            line = next(listening[step.path], None)
        except httpx.TransportError as error:
            del listening[step.path]
            raise no_answer(self.url, error) from error
        if line is None:
            del listening[step.path]
        return line

    def _of(self, path: str) -> httpx.Client:
        return self._http if path.startswith("/") else self._bucket

    @contextmanager
    def _respond(self, method: str, path: str, **request: Any) -> Iterator[httpx.Response]:
        try:
            with self._of(path).stream(method, path, **request) as response:
                if not response.is_success:
                    response.read()
                    raise from_response(response)
                yield response
        except httpx.TransportError as error:
            raise no_answer(self.url, error) from error

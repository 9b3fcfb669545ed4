"""The asynchronous client, with the same methods as ``Client``."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

import anyio
import httpx

from . import flows
from .connection import Connection, document
from .errors import ClientError, from_response, no_answer
from .saving import saving
from .steps import CHUNK_BYTES, DownloadStep, EventStep, Flow, PauseStep, RequestStep, Step

P = ParamSpec("P")
T = TypeVar("T")


def _method(
    flow: Callable[Concatenate[Connection, P], Flow[T]],
) -> Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, T]]:
    async def method(client: AsyncClient, /, *given: P.args, **named: P.kwargs) -> T:
        return await client._run(flow(client, *given, **named))

    document(method, flow)
    return method


class AsyncClient(Connection):
    """As :class:`Client`; use it with ``async with``, and await its methods."""

    def __init__(self, url: str, **options: Any) -> None:
        super().__init__(url, **options)
        self._http = httpx.AsyncClient(**self._options, transport=httpx.AsyncHTTPTransport(retries=2))

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    upload = _method(flows.upload)
    submit = _method(flows.submit)
    simulate = _method(flows.simulate)
    job = _method(flows.job)
    cancel = _method(flows.cancel)
    wait = _method(flows.wait)
    volume = _method(flows.volume)
    slice_png = _method(flows.slice_png)
    download = _method(flows.download)
    download_dataset = _method(flows.download_dataset)
    result = _method(flows.result)
    delete = _method(flows.delete)

    async def _run(self, flow: Flow[T]) -> T:
        flow = self._patience.through(flow)
        answer: Any = None
        error: ClientError | None = None
        async with AsyncExitStack() as streams:
            listening: dict[str, AsyncIterator[str]] = {}
            while True:
                try:
                    step = flow.send(answer) if error is None else flow.throw(error)
                except StopIteration as end:
                    value: T = end.value
                    return value
                try:
                    answer, error = await self._do(step, streams, listening), None
                except ClientError as failure:
                    answer, error = None, failure

    async def _do(self, step: Step, streams: AsyncExitStack, listening: dict[str, AsyncIterator[str]]) -> Any:
        if isinstance(step, PauseStep):
            return await anyio.sleep(step.seconds)
        if isinstance(step, RequestStep):
            content = None if step.body is None else _awaited(step.body())
            async with self._answer(step.method, step.path, content=content, **step.options) as response:
                await response.aread()
                return response
        if isinstance(step, DownloadStep):
            async with self._answer("GET", step.path, **step.options) as response:
                with saving(step, response) as save:
                    async for chunk in response.aiter_bytes(CHUNK_BYTES):
                        await anyio.to_thread.run_sync(save, chunk)
            return None
        return await self._listen(step, streams, listening)

    async def _listen(
        self, step: EventStep, streams: AsyncExitStack, listening: dict[str, AsyncIterator[str]]
    ) -> str | None:
        if step.path not in listening:
            answer = self._answer("GET", step.path, timeout=step.seconds)
            listening[step.path] = (await streams.enter_async_context(answer)).aiter_lines()
        try:
            line = await anext(listening[step.path], None)
        except httpx.TransportError as error:
            del listening[step.path]
            raise no_answer(self.url, error) from error
        if line is None:
            del listening[step.path]
        return line

    @asynccontextmanager
    async def _answer(self, method: str, path: str, **request: Any) -> AsyncIterator[httpx.Response]:
        try:
            async with self._http.stream(method, path, **request) as response:
                if not response.is_success:
                    await response.aread()
                    raise from_response(response)
                yield response
        except httpx.TransportError as error:
            raise no_answer(self.url, error) from error


async def _awaited(chunks: Iterator[bytes]) -> AsyncIterator[bytes]:
    """Read the chunks of a file in a thread."""
    while (chunk := await anyio.to_thread.run_sync(next, chunks, None)) is not None:
        yield chunk

"""The synchronous and the asynchronous client: upload a scan, run a job, download the result."""

from __future__ import annotations

import inspect
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, contextmanager
from functools import update_wrapper
from types import MethodType
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, Self, TypeVar, overload

import anyio
import httpx
from tenacity import AsyncRetrying, Retrying

from ..web.outbound import AsyncTransport, Transport
from . import flows, lists, waiting
from .connection import (
    CHUNK_BYTES,
    Connection,
    DownloadStep,
    EventStep,
    Flow,
    PauseStep,
    RequestStep,
    Step,
    saving,
)
from .errors import ClientError, from_response, no_answer

T = TypeVar("T")
P = ParamSpec("P")


class _Blocking(Protocol):
    def _run(self, flow: Flow[T]) -> T: ...


class _Awaiting(Protocol):
    async def _run(self, flow: Flow[T]) -> T: ...


class _Operation(Generic[P, T]):
    """A method of both clients: of one it returns the value, of the other a coroutine of it."""

    def __init__(self, flow: Callable[Concatenate[Connection, P], Flow[T]]) -> None:
        def blocking(client: Any, /, *args: P.args, **kwargs: P.kwargs) -> T:
            return client._run(flow(client, *args, **kwargs))  # type: ignore[no-any-return]

        async def awaiting(client: Any, /, *args: P.args, **kwargs: P.kwargs) -> T:
            return await client._run(flow(client, *args, **kwargs))  # type: ignore[no-any-return]

        self._methods: tuple[Any, Any] = blocking, awaiting
        for method in self._methods:
            _document(method, flow)

    @overload
    def __get__(self, client: _Blocking, kind: Any = None) -> Callable[P, T]: ...
    @overload
    def __get__(self, client: _Awaiting, kind: Any = None) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, client: Any, kind: Any = None) -> Any:
        method = self._methods[inspect.iscoroutinefunction(kind._run)]
        return method if client is None else MethodType(method, client)


def _document(method: Callable[..., Any], flow: Callable[..., Any]) -> None:
    """Copy name, docstring and signature from a flow to a method, with its result as return type."""
    update_wrapper(method, flow)
    signature = inspect.signature(flow)
    first, *others = signature.parameters.values()
    result = str(signature.return_annotation).removeprefix("Flow[").removesuffix("]")
    kind = others[0].kind if others else first.kind
    parameters = [first.replace(name="self", annotation=first.empty, kind=kind), *others]
    documented = signature.replace(parameters=parameters, return_annotation=result)
    method.__signature__ = documented  # type: ignore[attr-defined]


class Operations(Connection):
    """Operations of both clients; ``_run`` executes the flow of an operation."""

    _http: Any
    _bucket: Any

    def _connection_of(self, path: str) -> Any:
        return self._http if path.startswith("/") else self._bucket

    upload = _Operation(flows.upload)
    correct_dataset = _Operation(flows.correct_dataset)
    submit = _Operation(flows.submit)
    simulate = _Operation(flows.simulate)
    reconstruct = _Operation(flows.reconstruct)
    wait = _Operation(waiting.wait)
    cancel = _Operation(flows.cancel)
    submit_batch = _Operation(flows.submit_batch)
    wait_batch = _Operation(waiting.wait_batch)
    cancel_batch = _Operation(flows.cancel_batch)
    batch = _Operation(lists.batch)
    batches = _Operation(lists.batches)
    result = _Operation(flows.result)
    download = _Operation(flows.download)
    download_dataset = _Operation(flows.download_dataset)
    delete = _Operation(flows.delete)
    create_project = _Operation(lists.create_project)
    set_member = _Operation(lists.set_member)
    delete_project = _Operation(lists.delete_project)
    project = _Operation(lists.project)
    projects = _Operation(lists.projects)
    datasets = _Operation(lists.datasets)
    jobs = _Operation(lists.jobs)
    volumes = _Operation(lists.volumes)
    meshes = _Operation(lists.meshes)
    dataset = _Operation(lists.dataset)
    job = _Operation(lists.job)
    volume = _Operation(lists.volume)
    quality = _Operation(lists.quality)
    quality_png = _Operation(lists.quality_png)
    slice_png = _Operation(lists.slice_png)
    refraction_png = _Operation(lists.refraction_png)


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

    @contextmanager
    def _respond(self, method: str, path: str, **request: Any) -> Iterator[httpx.Response]:
        try:
            with self._connection_of(path).stream(method, path, **request) as response:
                if not response.is_success:
                    response.read()
                    raise from_response(response)
                yield response
        except httpx.TransportError as error:
            raise no_answer(self.url, error) from error


class AsyncClient(Operations):
    """Like :class:`Client`; use it with ``async with``, and await its methods."""

    def _open(self) -> None:
        self._http = httpx.AsyncClient(**self._options, transport=AsyncTransport(retries=2))
        self._bucket = httpx.AsyncClient(timeout=self._options["timeout"], transport=AsyncTransport())

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()
        await self._bucket.aclose()

    async def _run(self, flow: Flow[T]) -> T:
        advance: Callable[[Any], Step] = flow.send
        outcome: Any = None
        async with AsyncExitStack() as streams:
            listening: dict[str, AsyncIterator[str]] = {}
            while True:
                try:
                    step = advance(outcome)
                except StopIteration as end:
                    return end.value  # type: ignore[no-any-return]
                try:
                    retrying = AsyncRetrying(sleep=anyio.sleep, **self._retries.options(step))
                    advance, outcome = flow.send, await retrying(self._do, step, streams, listening)
                except ClientError as error:
                    advance, outcome = flow.throw, error

    async def _do(self, step: Step, streams: AsyncExitStack, listening: dict[str, AsyncIterator[str]]) -> Any:
        if isinstance(step, PauseStep):
            return await anyio.sleep(step.seconds)
        if isinstance(step, RequestStep):
            content = None if step.body is None else _as_async(step.body())
            async with self._respond(step.method, step.path, content=content, **step.options) as response:
                await response.aread()
                return response
        if isinstance(step, DownloadStep):
            async with self._respond("GET", step.path, **step.options) as response:
                with saving(step, response) as save:
                    async for chunk in response.aiter_bytes(CHUNK_BYTES):
                        await anyio.to_thread.run_sync(save, chunk)
            return None
        return await self._listen(step, streams, listening)

    async def _listen(
        self, step: EventStep, streams: AsyncExitStack, listening: dict[str, AsyncIterator[str]]
    ) -> str | None:
        if step.path not in listening:
            response = self._respond("GET", step.path, timeout=step.seconds)
            listening[step.path] = (await streams.enter_async_context(response)).aiter_lines()
        try:
            line = await anext(listening[step.path], None)
        except httpx.TransportError as error:
            del listening[step.path]
            raise no_answer(self.url, error) from error
        if line is None:
            del listening[step.path]
        return line

    @asynccontextmanager
    async def _respond(self, method: str, path: str, **request: Any) -> AsyncIterator[httpx.Response]:
        try:
            async with self._connection_of(path).stream(method, path, **request) as response:
                if not response.is_success:
                    await response.aread()
                    raise from_response(response)
                yield response
        except httpx.TransportError as error:
            raise no_answer(self.url, error) from error


async def _as_async(chunks: Iterator[bytes]) -> AsyncIterator[bytes]:
    """Read the chunks of a file in a thread."""
    while (chunk := await anyio.to_thread.run_sync(next, chunks, None)) is not None:
        yield chunk

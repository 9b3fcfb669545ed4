"""The asynchronous client, with the same methods as ``Client``."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any, Concatenate, ParamSpec, Self, TypeVar, Unpack

import anyio
import httpx

from ..web.outbound import AsyncTransport
from . import batches as batch_flows
from . import flows, lists, pictures
from . import projects as project_flows
from .connection import Connection, ConnectionOptions, document
from .errors import ClientError, from_response, no_answer
from .saving import saving
from .steps import CHUNK_BYTES, DownloadStep, EventStep, Flow, FlowRun, PauseStep, RequestStep, Step

P = ParamSpec("P")
T = TypeVar("T")


def _method(
    flow: Callable[Concatenate[Connection, P], Flow[T]],
) -> Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, T]]:
    async def method(client: AsyncClient, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return await client._run(flow(client, *args, **kwargs))

    document(method, flow)
    return method


class AsyncClient(Connection):
    """As :class:`Client`; use it with ``async with``, and await its methods."""

    def __init__(self, url: str, key: str | None = None, **options: Unpack[ConnectionOptions]) -> None:
        super().__init__(url, key, **options)
        self._http = httpx.AsyncClient(**self._options, transport=AsyncTransport(retries=2))
        # For addresses of the bucket, which must not see the key.
        self._bucket = httpx.AsyncClient(timeout=self._options["timeout"], transport=AsyncTransport())

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()
        await self._bucket.aclose()

    upload = _method(flows.upload)
    correct_dataset = _method(flows.correct_dataset)
    submit = _method(flows.submit)
    simulate = _method(flows.simulate)
    reconstruct = _method(flows.reconstruct)
    wait = _method(flows.wait)
    cancel = _method(flows.cancel)
    submit_batch = _method(batch_flows.submit_batch)
    wait_batch = _method(batch_flows.wait_batch)
    cancel_batch = _method(batch_flows.cancel_batch)
    batch = _method(batch_flows.batch)
    batches = _method(batch_flows.batches)
    result = _method(flows.result)
    download = _method(flows.download)
    download_dataset = _method(flows.download_dataset)
    delete = _method(flows.delete)
    create_project = _method(project_flows.create_project)
    set_member = _method(project_flows.set_member)
    delete_project = _method(project_flows.delete_project)
    project = _method(project_flows.project)
    projects = _method(project_flows.projects)
    datasets = _method(lists.datasets)
    jobs = _method(lists.jobs)
    volumes = _method(lists.volumes)
    meshes = _method(lists.meshes)
    dataset = _method(lists.dataset)
    job = _method(lists.job)
    volume = _method(lists.volume)
    quality = _method(lists.quality)
    quality_png = _method(pictures.quality_png)
    slice_png = _method(pictures.slice_png)
    refraction_png = _method(pictures.refraction_png)

    async def _run(self, flow: Flow[T]) -> T:
        run = FlowRun(self._retries.through(flow))
        outcome: Any = None
        async with AsyncExitStack() as streams:
            listening: dict[str, AsyncIterator[str]] = {}
            while (step := run.next(outcome)) is not None:
                try:
                    outcome = await self._do(step, streams, listening)
                except ClientError as error:
                    outcome = error
        return run.result

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

    def _of(self, path: str) -> httpx.AsyncClient:
        return self._http if path.startswith("/") else self._bucket

    @asynccontextmanager
    async def _respond(self, method: str, path: str, **request: Any) -> AsyncIterator[httpx.Response]:
        try:
            async with self._of(path).stream(method, path, **request) as response:
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

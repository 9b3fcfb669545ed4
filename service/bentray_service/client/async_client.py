"""The client for programs with an event loop: the same calls as ``Client``, awaited."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Generator, Iterator, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import anyio
import httpx

from . import flows
from .errors import ClientError, from_response, no_answer
from .flows import Format, Record
from .patience import PATIENCE_S, Patience
from .results import Result
from .saving import saving
from .steps import CHUNK_BYTES, Ask, Fetch, Listen, Pause, Step, settings_of
from .uploading import Kind, OnBytes, upload
from .waiting import wait

T = TypeVar("T")


class AsyncClient:
    """As :class:`Client`; use it with ``async with``.

    Args:
        url, key, timeout_s, poll_s, patience_s, on_wait: as of ``Client``.

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
        settings = settings_of(url, key, timeout_s)
        self.url: str = settings["base_url"]
        self._poll_s = poll_s
        self._patience = Patience(patience_s, on_wait)
        self._http = httpx.AsyncClient(**settings, transport=httpx.AsyncHTTPTransport(retries=2))

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def upload(
        self,
        path: Path | str,
        on_progress: OnBytes | None = None,
        *,
        kind: Kind = "dataset",
        resume: str | None = None,
        **said: str,
    ) -> Record:
        """See ``Client.upload``."""
        return await self._run(upload(Path(path), on_progress, kind, resume, said))

    async def submit(self, dataset_id: str, settings: Mapping[str, Any] | None = None) -> Record:
        """See ``Client.submit``."""
        return await self._run(flows.submit(dataset_id, settings))

    async def simulate(self, settings: Mapping[str, Any] | None = None) -> Record:
        """See ``Client.simulate``."""
        return await self._run(flows.simulate(settings))

    async def job(self, job_id: str) -> Record:
        """See ``Client.job``."""
        return await self._run(flows.record("GET", f"/v1/jobs/{job_id}"))

    async def cancel(self, job_id: str) -> Record:
        """See ``Client.cancel``."""
        return await self._run(flows.record("POST", f"/v1/jobs/{job_id}/cancel"))

    async def wait(
        self,
        job_id: str,
        on_progress: Callable[[Record], None] | None = None,
        timeout_s: float | None = None,
    ) -> Record:
        """See ``Client.wait``."""
        return await self._run(wait(job_id, on_progress, timeout_s, self._poll_s))

    async def volume(self, volume_id: str) -> Record:
        """See ``Client.volume``."""
        return await self._run(flows.record("GET", f"/v1/volumes/{volume_id}"))

    async def slice_png(self, volume_id: str, **how: str | float) -> bytes:
        """See ``Client.slice_png``."""
        return await self._run(flows.picture(f"/v1/volumes/{volume_id}/slice.png", how))

    async def download(self, volume_id: str, format: Format, path: Path | str) -> Path:  # noqa: A002
        """See ``Client.download``."""
        return await self._run(flows.download(volume_id, format, Path(path)))

    async def download_dataset(
        self, dataset_id: str, path: Path | str, on_progress: OnBytes | None = None
    ) -> Path:
        """See ``Client.download_dataset``."""
        return await self._run(flows.download_dataset(dataset_id, Path(path), on_progress))

    async def result(self, volume_id: str) -> Result:
        """See ``Client.result``."""
        return await self._run(flows.result(volume_id))

    async def delete(self, stored_id: str) -> None:
        """See ``Client.delete``."""
        await self._run(flows.delete(stored_id))

    async def _run(self, flow: Generator[Step, Any, T]) -> T:
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
        if isinstance(step, Pause):
            return await anyio.sleep(step.seconds)
        if isinstance(step, Ask):
            content = None if step.body is None else _awaited(step.body())
            async with self._answer(step.method, step.path, content=content, **step.options) as response:
                await response.aread()
                return response
        if isinstance(step, Fetch):
            async with self._answer("GET", step.path, **step.options) as response:
                with saving(step, response) as save:
                    async for chunk in response.aiter_bytes(CHUNK_BYTES):
                        await anyio.to_thread.run_sync(save, chunk)
            return None
        return await self._listen(step, streams, listening)

    async def _listen(
        self, step: Listen, streams: AsyncExitStack, listening: dict[str, AsyncIterator[str]]
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
    """The chunks of a file, read in a thread."""
    while (chunk := await anyio.to_thread.run_sync(next, chunks, None)) is not None:
        yield chunk

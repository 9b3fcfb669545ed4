"""The client for programs that wait: upload a scan, run a job, fetch the result."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

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


class Client:
    """A connection to one service; use it as a context manager.

    Every method raises :class:`ClientError` when the service refuses or does not answer.

    Args:
        url: of the service.
        key: an API key, where the service asks for one.
        timeout_s: how long an answer may take.
        poll_s: how often a job is looked at where its events do not come through.
        patience_s: how long to go on asking a service that has answered before and is away now, as when it or
            its database is started again. Only what is safe to repeat is repeated: looking, downloading,
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
        settings = settings_of(url, key, timeout_s)
        self.url: str = settings["base_url"]
        self._poll_s = poll_s
        self._patience = Patience(patience_s, on_wait)
        self._http = httpx.Client(**settings, transport=httpx.HTTPTransport(retries=2))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def upload(
        self,
        path: Path | str,
        on_progress: OnBytes | None = None,
        *,
        kind: Kind = "dataset",
        resume: str | None = None,
        **said: str,
    ) -> Record:
        """Upload a file, a large one in pieces, which go on after the connection broke.

        Args:
            path: of the file.
            on_progress: told ``(sent, total)``, bytes.
            kind: what it is.
            resume: the id of an upload to go on with: ``ClientError.upload`` of the one that was broken off.
            said: of a volume or a mesh its ``title``, of a volume ``spacing_m``, ``shape`` and ``dtype`` too.

        Returns:
            The record of the dataset, the volume or the mesh.
        """
        return self._run(upload(Path(path), on_progress, kind, resume, said))

    def submit(self, dataset_id: str, settings: Mapping[str, Any] | None = None) -> Record:
        """Start a reconstruction; settings left out take their defaults. Returns the job record."""
        return self._run(flows.submit(dataset_id, settings))

    def simulate(self, settings: Mapping[str, Any] | None = None) -> Record:
        """Start the simulation of a scan; the job's ``dataset`` is its id once the job has succeeded."""
        return self._run(flows.simulate(settings))

    def job(self, job_id: str) -> Record:
        """The job record as it is now."""
        return self._run(flows.record("GET", f"/v1/jobs/{job_id}"))

    def cancel(self, job_id: str) -> Record:
        """Ask a job to stop."""
        return self._run(flows.record("POST", f"/v1/jobs/{job_id}/cancel"))

    def wait(
        self,
        job_id: str,
        on_progress: Callable[[Record], None] | None = None,
        timeout_s: float | None = None,
    ) -> Record:
        """Wait until a job has succeeded and return its record; ``on_progress`` gets every record before.

        Raises:
            ClientError: when the job failed (with its problem), was cancelled, or exceeds ``timeout_s``.
        """
        return self._run(wait(job_id, on_progress, timeout_s, self._poll_s))

    def volume(self, volume_id: str) -> Record:
        """The metadata of a result."""
        return self._run(flows.record("GET", f"/v1/volumes/{volume_id}"))

    def slice_png(self, volume_id: str, **how: str | float) -> bytes:
        """One slice as PNG; ``how``: index, quantity, low, high, colormap."""
        return self._run(flows.picture(f"/v1/volumes/{volume_id}/slice.png", how))

    def download(self, volume_id: str, format: Format, path: Path | str) -> Path:  # noqa: A002
        """Fetch a result into ``path``; the file is there whole or not at all."""
        return self._run(flows.download(volume_id, format, Path(path)))

    def download_dataset(self, dataset_id: str, path: Path | str, on_progress: OnBytes | None = None) -> Path:
        """Fetch a scan, uploaded or simulated, into ``path``; ``on_progress`` as of ``upload``."""
        return self._run(flows.download_dataset(dataset_id, Path(path), on_progress))

    def result(self, volume_id: str) -> Result:
        """A volume as arrays with coordinates; ``.to_xarray()`` makes a dataset of xarray of it."""
        return self._run(flows.result(volume_id))

    def delete(self, stored_id: str) -> None:
        """Delete a dataset, a volume or a mesh with all that was made of it."""
        self._run(flows.delete(stored_id))

    def _run(self, flow: Generator[Step, Any, T]) -> T:
        flow = self._patience.through(flow)
        answer: Any = None
        error: ClientError | None = None
        with ExitStack() as streams:
            listening: dict[str, Iterator[str]] = {}
            while True:
                try:
                    step = flow.send(answer) if error is None else flow.throw(error)
                except StopIteration as end:
                    value: T = end.value
                    return value
                try:
                    answer, error = self._do(step, streams, listening), None
                except ClientError as failure:
                    answer, error = None, failure

    def _do(self, step: Step, streams: ExitStack, listening: dict[str, Iterator[str]]) -> Any:
        if isinstance(step, Pause):
            return time.sleep(step.seconds)
        if isinstance(step, Ask):
            content = None if step.body is None else step.body()
            with self._answer(step.method, step.path, content=content, **step.options) as response:
                response.read()
                return response
        if isinstance(step, Fetch):
            with self._answer("GET", step.path, **step.options) as response, saving(step, response) as save:
                for chunk in response.iter_bytes(CHUNK_BYTES):
                    save(chunk)
            return None
        return self._listen(step, streams, listening)

    def _listen(self, step: Listen, streams: ExitStack, listening: dict[str, Iterator[str]]) -> str | None:
        if step.path not in listening:
            response = streams.enter_context(self._answer("GET", step.path, timeout=step.seconds))
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
    def _answer(self, method: str, path: str, **request: Any) -> Iterator[httpx.Response]:
        try:
            with self._http.stream(method, path, **request) as response:
                if not response.is_success:
                    response.read()
                    raise from_response(response)
                yield response
        except httpx.TransportError as error:
            raise no_answer(self.url, error) from error

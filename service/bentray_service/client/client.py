"""The synchronous client: upload a scan, run a job, fetch the result."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import httpx

from bentray_kernels.errors import InvalidInput

from .errors import ClientError, from_problem, from_response

CHUNK_BYTES = 1024 * 1024
ENDED = ("succeeded", "failed", "cancelled")


class Client:
    """A connection to one service; use it as a context manager.

    Every method raises :class:`ClientError` when the service refuses or does not answer.

    Raises:
        InvalidInput: for a ``url`` that is no web address.
    """

    def __init__(self, url: str, *, timeout_s: float = 300.0, poll_s: float = 0.3) -> None:
        self.url = _checked(url).rstrip("/")
        self._poll_s = poll_s
        # The answer to an upload comes after the service has read the whole file.
        timeout = httpx.Timeout(timeout_s, connect=10.0)
        self._http = httpx.Client(
            base_url=self.url, timeout=timeout, transport=httpx.HTTPTransport(retries=2)
        )

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
        self, path: Path | str, on_progress: Callable[[int, int], None] | None = None
    ) -> dict[str, Any]:
        """Upload a dataset file; ``on_progress(sent, total)`` counts bytes. Returns the dataset record."""
        path = Path(path)
        try:
            total = path.stat().st_size
            with path.open("rb") as file:
                headers = {"Content-Type": "application/x-hdf5", "Content-Length": str(total)}
                body = _chunks(file.read, total, on_progress)
                return self._json("POST", "/v1/datasets", content=body, headers=headers)
        except OSError as error:
            raise ClientError(f"{path} cannot be read: {error.strerror}") from error

    def submit(self, dataset_id: str, settings: dict[str, Any] | None = None) -> dict[str, Any]:
        """Start a reconstruction; settings left out take their defaults. Returns the job record."""
        asked = {"kind": "reconstruction", "dataset": dataset_id, "settings": settings or {}}
        return self._json("POST", "/v1/jobs", json=asked)

    def job(self, job_id: str) -> dict[str, Any]:
        """The job record as it is now."""
        return self._json("GET", f"/v1/jobs/{job_id}")

    def cancel(self, job_id: str) -> dict[str, Any]:
        """Ask a job to stop."""
        return self._json("POST", f"/v1/jobs/{job_id}/cancel")

    def wait(
        self,
        job_id: str,
        on_progress: Callable[[dict[str, Any]], None] | None = None,
        timeout_s: float | None = None,
    ) -> dict[str, Any]:
        """Wait until a job has succeeded and return its record; ``on_progress`` gets every record before.

        Raises:
            ClientError: when the job failed (with its problem), was cancelled, or exceeds ``timeout_s``.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            job = self.job(job_id)
            if on_progress is not None:
                on_progress(job)
            if job["state"] == "succeeded":
                return job
            if job["state"] == "failed":
                raise from_problem(job["error"])
            if job["state"] == "cancelled":
                raise ClientError(f"{job_id} was cancelled")
            if deadline is not None and time.monotonic() > deadline:
                raise ClientError(f"{job_id} is still {job['state']} after {timeout_s:g} s")
            time.sleep(self._poll_s)

    def volume(self, volume_id: str) -> dict[str, Any]:
        """The metadata of a result."""
        return self._json("GET", f"/v1/volumes/{volume_id}")

    def slice_png(self, volume_id: str, **how: str | float) -> bytes:
        """One slice as PNG; ``how``: index, quantity, low, high, colormap."""
        with self._request("GET", f"/v1/volumes/{volume_id}/slice.png", params=how) as response:
            return response.read()

    def download(self, volume_id: str, format: Literal["hdf5", "nifti", "npy"], path: Path | str) -> Path:  # noqa: A002
        """Fetch a result into ``path``; the file is there whole or not at all."""
        path = Path(path)
        partial = path.with_name(f"{path.name}.partial")
        try:
            with (
                self._request("GET", f"/v1/volumes/{volume_id}/data", params={"format": format}) as response,
                partial.open("wb") as file,
            ):
                for chunk in response.iter_bytes(CHUNK_BYTES):
                    file.write(chunk)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
        except OSError as error:
            raise ClientError(f"{path} cannot be written: {error.strerror}") from error
        finally:
            partial.unlink(missing_ok=True)
        return path

    def _json(self, method: str, path: str, **request: Any) -> dict[str, Any]:
        with self._request(method, path, **request) as response:
            response.read()
            return dict(response.json())

    @contextmanager
    def _request(self, method: str, path: str, **request: Any) -> Iterator[httpx.Response]:
        try:
            with self._http.stream(method, path, **request) as response:
                if not response.is_success:
                    response.read()
                    raise from_response(response)
                yield response
        except httpx.TransportError as error:
            raise ClientError(f"no answer from {self.url}: {error}") from error


def _checked(url: str) -> str:
    try:
        parsed = httpx.URL(url)
    except httpx.InvalidURL:
        parsed = httpx.URL()
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise InvalidInput("url", repr(url), "a web address, such as http://127.0.0.1:8000")
    return url


def _chunks(
    read: Callable[[int], bytes], total: int, on_progress: Callable[[int, int], None] | None
) -> Iterator[bytes]:
    sent = 0
    while chunk := read(CHUNK_BYTES):
        yield chunk
        sent += len(chunk)
        if on_progress is not None:
            on_progress(sent, total)

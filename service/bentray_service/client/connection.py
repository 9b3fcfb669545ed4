"""Steps of the flows of both clients, their common options, retries of idempotent requests, and downloads.

A flow is a generator that yields steps and receives their results; errors are raised in it as
:class:`ClientError`. ``Client`` and ``AsyncClient`` execute the same flows.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import httpx
from tenacity import RetryCallState, stop_before_delay, wait_exponential

from bentray_kernels.errors import InvalidInput

from .errors import ClientError, NoAnswer

# Time for which requests are retried, s.
PATIENCE_S = 300.0
# Pauses between attempts, s; each is twice the previous one.
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 15.0

# Status codes of a proxy without its service, and of a service without its database.
UNAVAILABLE = (502, 503, 504)
# An internal error may be temporary, so it is retried a few times.
ERROR, MAX_ERRORS = 500, 5
CONNECT_S = 10.0
CHUNK_BYTES = 1024 * 1024

T = TypeVar("T")


@dataclass(frozen=True)
class RequestStep:
    """A request; its result is the complete response.

    Attributes:
        method, path: of the service.
        options: for ``httpx``: ``params``, ``json``, ``headers``.
        body: generates the chunks of the body.
        repeatable: whether the request is idempotent.
        until: end of retries, by ``time.monotonic``; None: unlimited.
    """

    method: str
    path: str
    options: Mapping[str, Any] = field(default_factory=dict)
    body: Callable[[], Iterator[bytes]] | None = None
    repeatable: bool = False
    until: float | None = None


@dataclass(frozen=True)
class DownloadStep:
    """An atomic download to a file, without a result.

    Attributes:
        path, options: of the request.
        target: the file.
        on_progress: called with (received bytes, total bytes).
    """

    path: str
    options: Mapping[str, Any]
    target: Path
    on_progress: Callable[[int, int], None] | None = None


@dataclass(frozen=True)
class EventStep:
    """Read the next line of an event stream, which is opened on first use.

    The result is the line, or None at the end of the stream.

    Attributes:
        path: of the stream.
        seconds: time limit for a line.
    """

    path: str
    seconds: float


@dataclass(frozen=True)
class PauseStep:
    """A pause, without a result."""

    seconds: float


Step = RequestStep | DownloadStep | EventStep | PauseStep
Flow: TypeAlias = Generator[Step, Any, T]


def unavailable(error: ClientError) -> bool:
    """Whether the same request may succeed later."""
    return isinstance(error, NoAnswer) or error.status in (*UNAVAILABLE, ERROR)


class Retries:
    """Retries the requests of one client.

    Requests to a service that has never answered are not retried, since the address may be wrong.

    Args:
        seconds: time limit from the first attempt of a request.
        on_message: called with a message when retries begin and when they end.
    """

    def __init__(self, seconds: float, on_message: Callable[[str], None] | None) -> None:
        self._seconds = seconds
        self._on_message = on_message
        self._answered = False

    def options(self, step: Step) -> dict[str, Any]:
        """The options of ``tenacity.Retrying`` and ``AsyncRetrying`` for one step, but for ``sleep``."""
        seconds, errors = self._seconds, 0
        if isinstance(step, RequestStep) and step.until is not None:
            seconds = min(seconds, step.until - time.monotonic())

        def again(state: RetryCallState) -> bool:
            nonlocal errors
            error = _error(state)
            if error is None:
                self._answered |= not isinstance(step, PauseStep)
                if state.attempt_number > 1:
                    self._report("The service answers again.")
                return False
            if not isinstance(error, ClientError):
                return False
            self._answered |= error.status is not None
            errors += error.status == ERROR
            return self._answered and repeatable(step, error) and errors < MAX_ERRORS

        def report(state: RetryCallState) -> None:
            if state.attempt_number == 1:
                self._report(f"{_error(state)}; retrying for up to {seconds:.0f} s.")

        stop = stop_before_delay(seconds)
        return {"retry": again, "wait": _pause, "stop": stop, "before_sleep": report, "reraise": True}

    def _report(self, line: str) -> None:
        if self._on_message is not None:
            self._on_message(line)


def _error(state: RetryCallState) -> BaseException | None:
    return None if state.outcome is None else state.outcome.exception()


def _pause(state: RetryCallState) -> float:
    pause = wait_exponential(FIRST_PAUSE_S, LONGEST_PAUSE_S)(state)
    return max(pause, getattr(_error(state), "retry_after_s", None) or 0.0)


def repeatable(step: Step, error: ClientError) -> bool:
    """Whether a failed step can be repeated without side effects."""
    if not isinstance(step, RequestStep | DownloadStep) or not unavailable(error):
        return False
    never_sent = isinstance(error, NoAnswer) and not error.sent
    return never_sent or isinstance(step, DownloadStep) or step.repeatable


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
        self._open()

    def _open(self) -> None:
        """Make the connections of a client, to the service and to its bucket, which must not see the key."""

    def __repr__(self) -> str:
        return f"<bentray.{type(self).__name__} of {self.url}>"


@contextmanager
def saving(step: DownloadStep, response: httpx.Response) -> Iterator[Callable[[bytes], None]]:
    """Yield a function that writes chunks; at the end, the file replaces the target.

    Args:
        step: target and progress callback.
        response: to be read in chunks.

    Raises:
        ClientError: when the file cannot be written.
    """
    target = step.target
    partial = target.with_name(f"{target.name}.partial")
    total = int(response.headers.get("content-length", 0))
    try:
        with partial.open("wb") as file:

            def save(chunk: bytes) -> None:
                file.write(chunk)
                if step.on_progress is not None:
                    step.on_progress(file.tell(), total)

            yield save
            file.flush()
            os.fsync(file.fileno())
        partial.replace(target)
    except OSError as error:
        raise ClientError(f"{target} cannot be written: {error.strerror}") from error
    finally:
        partial.unlink(missing_ok=True)

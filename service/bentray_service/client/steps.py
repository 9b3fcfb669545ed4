"""Steps of the flows of both clients: requests, downloads, event streams and pauses.

A flow is a generator that yields steps and receives their results; errors are raised in it as
:class:`ClientError`. ``Client`` and ``AsyncClient`` execute the same flows.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")

CHUNK_BYTES = 1024 * 1024


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

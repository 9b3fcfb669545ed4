"""What a client does one after the other, told apart from how: each call is a generator of steps.

A flow yields steps and is sent their answers; a step that fails is thrown into it as :class:`ClientError`.
``Client`` and ``AsyncClient`` walk through the same flows.
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
    """A request; its answer is the response, read, once it is a success.

    Attributes:
        method, path: of the service.
        options: as ``httpx`` takes them: ``params``, ``json``, ``headers``.
        body: makes the chunks of the body.
        repeatable: whether the service does nothing twice when the request comes again.
        until: when to stop repeating it, by ``time.monotonic``; None for no such time.
    """

    method: str
    path: str
    options: Mapping[str, Any] = field(default_factory=dict)
    body: Callable[[], Iterator[bytes]] | None = None
    repeatable: bool = False
    until: float | None = None


@dataclass(frozen=True)
class DownloadStep:
    """Download into a file, which is there whole or not at all; no answer.

    Attributes:
        path, options: of the request.
        target: the file.
        told: called with (bytes that came, bytes in all).
    """

    path: str
    options: Mapping[str, Any]
    target: Path
    told: Callable[[int, int], None] | None = None


@dataclass(frozen=True)
class EventStep:
    """Wait for the next line of a stream of events, which is opened at the first time.

    The answer is the line, or None when the stream has ended.

    Attributes:
        path: of the stream.
        seconds: of silence after which the connection counts as broken.
    """

    path: str
    seconds: float


@dataclass(frozen=True)
class PauseStep:
    """Wait so long; no answer."""

    seconds: float


Step = RequestStep | DownloadStep | EventStep | PauseStep
Flow: TypeAlias = Generator[Step, Any, T]

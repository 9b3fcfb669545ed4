"""Tasks of the render lane: on the workers of a cluster, or in the threads of this process."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from typing import Any, Protocol

from distributed import Client

from .fair_shares import Share
from .resources import RENDER
from .task_loop import POLL_S, finished


class Tasks(Protocol):
    """Where tasks are done; futures are those of Dask or of ``concurrent.futures``, which are alike here."""

    def may_begin(self, in_flight: int, ready: int) -> bool:
        """Whether to begin one more, with so many in flight and so many that could begin."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Begin a task; its future."""

    def ended(self, running: list[Any]) -> list[Any]:
        """The futures that have ended; waits for the first one, a moment at most."""


class ClusterTasks:
    """On a cluster.

    Args:
        client: of it.
        priority: above or below that of other tasks.
        share: of the workers.
    """

    def __init__(self, client: Client, priority: int, share: Share) -> None:
        self._client = client
        self._priority = priority
        self._share = share
        self._next = priority

    def may_begin(self, in_flight: int, ready: int) -> bool:
        self._next = self._priority + self._share.priority(in_flight)
        return self._share.may_begin(in_flight, ready)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Any:
        how = {"pure": False, "resources": RENDER, "priority": self._next}
        return self._client.submit(function, *arguments, **how)

    def ended(self, running: list[Any]) -> list[Any]:
        if not running:
            self._share.wait()
        return finished(self._client, running)


class ThreadTasks:
    """In threads of this process, one a core; compiled kernels let go of the GIL."""

    def __init__(self) -> None:
        self._threads = len(os.sched_getaffinity(0))
        self._pool = ThreadPoolExecutor(self._threads)

    def may_begin(self, in_flight: int, ready: int) -> bool:
        return ready > 0 and in_flight < self._threads

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return self._pool.submit(function, *arguments)

    def ended(self, running: list[Any]) -> list[Any]:
        return list(wait(running, timeout=POLL_S, return_when=FIRST_COMPLETED).done)

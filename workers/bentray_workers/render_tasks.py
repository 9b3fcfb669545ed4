"""Tasks of the render lane: on the workers of a cluster, or in the threads of this process."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from typing import Any, Protocol

from distributed import Client

from .connected import connected_workers
from .driving import IN_FLIGHT, POLL_S, finished
from .lanes import RENDER


class Tasks(Protocol):
    """Where tasks are done; futures are those of Dask or of ``concurrent.futures``, which are alike here.

    Attributes:
        window: how many may be in flight.
    """

    window: int

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Begin a task; its future."""

    def ended(self, running: list[Any]) -> list[Any]:
        """The futures that have ended; waits for the first one, a moment at most."""


class ClusterTasks:
    """On a cluster.

    Args:
        client: of it.
        priority: above or below that of other tasks.
    """

    def __init__(self, client: Client, priority: int) -> None:
        self._client = client
        self._priority = priority
        self.window = IN_FLIGHT * max(1, len(connected_workers(client)))

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Any:
        how = {"pure": False, "resources": RENDER, "priority": self._priority}
        return self._client.submit(function, *arguments, **how)

    def ended(self, running: list[Any]) -> list[Any]:
        return finished(self._client, running)


class ThreadTasks:
    """In threads of this process, one a core; compiled kernels let go of the GIL."""

    def __init__(self) -> None:
        self.window = len(os.sched_getaffinity(0))
        self._pool = ThreadPoolExecutor(self.window)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return self._pool.submit(function, *arguments)

    def ended(self, running: list[Any]) -> list[Any]:
        return list(wait(running, timeout=POLL_S, return_when=FIRST_COMPLETED).done)

"""Calls on a cluster that are tried again when their worker dies, unless they are what kills it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from distributed import Client, Future, KilledWorker

from .lanes import RECONSTRUCTION

# How often a call may see its workers die while it runs.
MOST_STRIKES = 2


class _Attempt(NamedTuple):
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    strikes: int
    marker: Path


class Attempts:
    """Calls of one job.

    Dask blames every task of a dead worker, also those that only waited there. So a call leaves a file where
    it runs, which stays when its process is killed: it tells which one was at work.

    Args:
        client: of the cluster.
        folder: for these files; every worker can write there. It is made if needed.
        resources: what each call asks of its worker; see ``lanes``.
    """

    def __init__(self, client: Client, folder: Path, resources: Mapping[str, int] = RECONSTRUCTION) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._client = client
        self._resources = dict(resources)
        self._markers = (folder / f"call-{number}" for number in count())
        self._made: dict[Future, _Attempt] = {}

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future:
        """Begin a call; its future is to be handed to ``again`` once it has ended."""
        return self._submit(_Attempt(function, arguments, 0, next(self._markers)))

    def again(self, future: Future) -> Future | None:
        """The same call once more, where its workers died and it may not be the cause; None otherwise."""
        made = self._made.pop(future)
        if future.status != "error" or not isinstance(future.exception(), KilledWorker):
            return None
        strikes = made.strikes + made.marker.exists()
        made.marker.unlink(missing_ok=True)
        return self._submit(made._replace(strikes=strikes)) if strikes <= MOST_STRIKES else None

    def _submit(self, attempt: _Attempt) -> Future:
        work = attempt.marker, attempt.function, *attempt.arguments
        future = self._client.submit(watched, *work, resources=self._resources, pure=False)
        self._made[future] = attempt
        return future


def watched(marker: Path, function: Callable[..., Any], *arguments: Any) -> Any:
    """Task: a call, with a file that is there as long as it runs."""
    marker.touch()
    try:
        return function(*arguments)
    finally:
        marker.unlink(missing_ok=True)

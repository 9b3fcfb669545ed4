"""Calls on a cluster that are tried again when their worker dies, unless they are what kills it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from distributed import Client, Future, KilledWorker

from .memory_cache import leave_room
from .resources import RECONSTRUCTION

# How often a call may see its workers die while it runs.
MOST_STRIKES = 2


class ResultsLostError(ConnectionError):
    """What a call needs has gone with its workers; whoever drives begins again from its checkpoint."""


class _Attempt(NamedTuple):
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    strikes: int
    priority: int
    marker: Path


class Attempts:
    """Calls of one job.

    Dask blames every task of a dead worker, also those that only waited there. So a call leaves a file where
    it runs, which stays when its process is killed: it tells which one was at work.

    Args:
        client: of the cluster.
        folder: for these files; every worker can write there. It is made if needed.
        resources: what each call asks of its worker; see ``resources``.
    """

    def __init__(self, client: Client, folder: Path, resources: Mapping[str, int] = RECONSTRUCTION) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._client = client
        self._resources = dict(resources)
        self._markers = (folder / f"call-{number}" for number in count())
        self._made: dict[Future, _Attempt] = {}

    def submit(self, function: Callable[..., Any], *arguments: Any, priority: int = 0) -> Future:
        """Begin a call; its future is to be handed to ``ended`` once it has ended.

        Args:
            function, arguments: what to call.
            priority: higher ones first, where calls wait for the same worker.
        """
        return self._submit(_Attempt(function, arguments, 0, priority, next(self._markers)))

    def ended(self, future: Future, *, keep: bool = False) -> tuple[Future | None, Any]:
        """What a call gave; or the same call once more, where its workers died and it may not be the cause.

        A result may go with its worker after it was made. Dask then makes it again by itself, and may blame
        it for the next death.

        Args:
            future: of a call that has ended.
            keep: leave the result where it is, and give the future for it.

        Returns:
            The future of the new attempt, or None and what the call gave.

        Raises:
            KilledWorker: for a call that kills its workers.
            ResultsLostError: where what it needs was lost with its workers and could not be made again.
        """
        made = self._made.pop(future)
        try:
            return None, future if keep and future.status == "finished" else future.result()
        except KilledWorker as error:
            strikes = made.strikes + made.marker.exists()
            made.marker.unlink(missing_ok=True)
            if strikes > MOST_STRIKES:
                raise
            if any(needed.status == "error" for needed in _futures(made.arguments)):
                raise ResultsLostError("what it needs was lost with its workers") from error
            return self._submit(made._replace(strikes=strikes)), None

    def _submit(self, attempt: _Attempt) -> Future:
        work = attempt.marker, attempt.function, *attempt.arguments
        how = {"resources": self._resources, "priority": attempt.priority, "pure": False}
        future = self._client.submit(watched, *work, **how)
        self._made[future] = attempt
        return future


def _futures(arguments: Iterable[Any]) -> Iterator[Future]:
    """Those among arguments, and in lists among them."""
    for argument in arguments:
        if isinstance(argument, Future):
            yield argument
        elif isinstance(argument, list):
            yield from _futures(argument)


def watched(marker: Path, function: Callable[..., Any], *arguments: Any) -> Any:
    """Task: a call, with a file that is there as long as it runs."""
    leave_room()
    marker.touch()
    try:
        return function(*arguments)
    finally:
        marker.unlink(missing_ok=True)

"""Chains of calls run to their end: one call after the other in this process, or several on a cluster."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from distributed import Client, Future, wait

from bentray_kernels.tomography.task_chains import Call

from .attempts import Attempts
from .fair_shares import Share

POLL_S = 0.2


class Cancelled(Exception):  # noqa: N818 - the word that users and states have for it
    """The caller asked to stop; what was done is dropped."""


class Follows(Protocol):
    """What says which calls follow one that has finished, see ``tomography.task_chains.Calls``."""

    def after(self, call: Call, given: Any) -> list[Call]: ...


# Runs calls, and those that follow them, to the last. Each has its chain's name beside it; told is which
# chain has moved, after each call.
Run = Callable[[list[tuple[str, Call]], Mapping[str, Follows], Callable[[str], None]], None]


def run_here(stop: Callable[[], bool] | None) -> Run:
    """Runs calls in this process, chain by chain.

    Args:
        stop: polled after each call; true ends with ``Cancelled``.
    """

    def run(
        first: list[tuple[str, Call]], chains: Mapping[str, Follows], moved: Callable[[str], None]
    ) -> None:
        ready = deque(first)
        while ready:
            name, call = ready.popleft()
            later = chains[name].after(call, call.function(*call.arguments))
            ready.extendleft((name, one) for one in reversed(later))
            moved(name)
            if stop is not None and stop():
                raise Cancelled

    return run


def run_on_cluster(client: Client, attempts: Attempts, share: Share, stop: Callable[[], bool] | None) -> Run:
    """Runs calls on a cluster, as many at a time as the job's share of the workers allows.

    Args:
        client: of the cluster.
        attempts: of the job.
        share: of the job; what is run and what it gives does not depend on it.
        stop: polled several times a second; true ends with ``Cancelled``.
    """

    def run(
        first: list[tuple[str, Call]], chains: Mapping[str, Follows], moved: Callable[[str], None]
    ) -> None:
        ready = deque(first)
        running: dict[Future, tuple[str, Call]] = {}
        try:
            while ready or running:
                while share.may_begin(len(running), len(ready)):
                    name, call = ready.popleft()
                    priority = share.priority(len(running))
                    running[attempts.submit(call.function, *call.arguments, priority=priority)] = name, call
                if not running:
                    share.wait()
                for future in finished(client, list(running)):
                    name, call = running.pop(future)
                    again, given = attempts.ended(future, keep=call.keep)
                    if again is not None:
                        running[again] = name, call
                        continue
                    # Before other slices begin: what an iteration keeps is freed by its end.
                    later = chains[name].after(call, given)
                    ready.extendleft((name, one) for one in reversed(later))
                    moved(name)
                if stop is not None and stop():
                    raise Cancelled
        finally:
            for future in running:
                future.cancel()
            share.pause()

    return run


def finished(client: Client, running: list[Future]) -> list[Future]:
    """Those that have ended; waits for the first one, ``POLL_S`` at most. Of none there are none."""
    # The client is nobody's default, so ``wait`` must be told which it is.
    with client.as_current():
        try:
            return list(wait(running, timeout=POLL_S, return_when="FIRST_COMPLETED").done)
        except TimeoutError:
            return []

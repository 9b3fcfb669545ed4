"""Job events for all event streams, polled by one database query."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import anyio
from sqlalchemy.exc import SQLAlchemyError

from ..errors import DatabaseUnavailable, TooManyStreams
from ..rows.jobs import Jobs
from ..rows.tenants import Tenant
from ..rows.typed_rows import EventRow, JobProgress

log = logging.getLogger("bentray.jobs")

# Interval between database queries, and the shorter one after a new stream was opened.
INTERVAL_SECONDS = 0.5
SOONEST_SECONDS = 0.05
# Maximum number of open streams. Each holds a connection, but no thread and no query.
OF_TENANT = 64
IN_ALL = 256


class WatchedJob:
    """A job with at least one event stream.

    Attributes:
        row: its state and progress; None before the first query.
        gone: whether it has been deleted.
        events: all its events, oldest first.
        watchers: number of streams.
    """

    def __init__(self) -> None:
        self.row: JobProgress | None = None
        self.gone = False
        self.events: list[EventRow] = []
        self.watchers = 0
        self._news = asyncio.Event()

    async def wait_for_change(self, seconds: float) -> None:
        """Wait until the state, the progress or the events change, at most ``seconds``."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._news.wait()

    def notify(self) -> None:
        """Wake all waiting streams."""
        self._news.set()
        self._news = asyncio.Event()

    def update(self, row: JobProgress | None, events: list[EventRow]) -> None:
        """Store the result of a query."""
        changed = row != self.row or bool(events) or (row is None) != self.gone
        self.row, self.gone = row, row is None
        self.events += events
        if changed:
            self.notify()


class EventFeed:
    """Polls the watched jobs while there are any; it must be used from the event loop only."""

    def __init__(self, jobs: Jobs, leaving: Callable[[], bool]) -> None:
        """Args:
        jobs: the table of jobs.
        leaving: whether the service stops; then every stream is woken.
        """
        self._jobs = jobs
        self.leaving = leaving
        self._watched: dict[str, WatchedJob] = {}
        self._streams: Counter[Tenant] = Counter()
        self._polling: asyncio.Task[None] | None = None
        self._asked = asyncio.Event()

    @contextmanager
    def watch(self, tenant: Tenant, job_id: str) -> Iterator[WatchedJob]:
        """Watch a job in a ``with`` block; the caller has checked the owner.

        Raises:
            TooManyStreams: when too many streams are open, of the tenant or in total.
        """
        accepted = f"at most {OF_TENANT} per tenant and {IN_ALL} in total; poll GET /v1/jobs/{job_id} instead"
        if self._streams[tenant] >= OF_TENANT:
            raise TooManyStreams("event streams", f"{OF_TENANT} streams of this tenant are open", accepted)
        if self._streams.total() >= IN_ALL:
            raise TooManyStreams("event streams", f"{IN_ALL} streams are open", accepted)
        self._streams[tenant] += 1
        watched = self._watched.setdefault(job_id, WatchedJob())
        watched.watchers += 1
        if watched.row is None:
            self._asked.set()
        if self._polling is None:
            self._polling = asyncio.create_task(self._poll())
        try:
            yield watched
        finally:
            watched.watchers -= 1
            if not watched.watchers:
                del self._watched[job_id]
            self._streams[tenant] -= 1
            if not self._streams[tenant]:
                del self._streams[tenant]

    async def _poll(self) -> None:
        # A thread of its own, so that polling does not wait for other work.
        limiter = anyio.CapacityLimiter(1)
        try:
            while self._watched:
                self._asked.clear()
                watched = dict(self._watched)
                known = {
                    job_id: one.events[-1]["number"] if one.events else 0 for job_id, one in watched.items()
                }
                try:
                    progress, events = await anyio.to_thread.run_sync(
                        self._jobs.updates, known, limiter=limiter
                    )
                except (SQLAlchemyError, DatabaseUnavailable) as error:
                    log.warning("watched jobs could not be read: %s", error)
                else:
                    for job_id, one in watched.items():
                        one.update(progress.get(job_id), events.get(job_id, []))
                if self.leaving():
                    for one in self._watched.values():
                        one.notify()
                await asyncio.sleep(min(SOONEST_SECONDS, INTERVAL_SECONDS))
                with suppress(TimeoutError):
                    async with asyncio.timeout(INTERVAL_SECONDS):
                        await self._asked.wait()
        finally:
            self._polling = None

"""What happens to jobs, for all who watch: one look at the database for every stream of events there is."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import anyio
from sqlalchemy.exc import SQLAlchemyError

from ..refusals import DatabaseUnavailable, TooManyStreams
from ..rows.jobs import Jobs
from ..rows.records import EventRow, JobProgress
from ..rows.tenants import Tenant

log = logging.getLogger("bentray.jobs")

# How often the database is asked, and how soon again for those who have just come.
INTERVAL_SECONDS = 0.5
SOONEST_SECONDS = 0.05
# Streams that may be open. Each holds a connection, no thread and no query of its own.
OF_TENANT = 64
IN_ALL = 256


class WatchedJob:
    """One job that is watched.

    Attributes:
        row: how it is: ``state``, ``done``, ``total`` and ``phase``; None before it was looked at.
        gone: whether there is no such job any more.
        events: all of it, oldest first.
        watchers: how many watch it.
    """

    def __init__(self) -> None:
        self.row: JobProgress | None = None
        self.gone = False
        self.events: list[EventRow] = []
        self.watchers = 0
        self._news = asyncio.Event()

    async def wait_for_change(self, seconds: float) -> None:
        """Wait until something has changed, at most so long."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._news.wait()

    def notify(self) -> None:
        """Wake all who wait."""
        self._news.set()
        self._news = asyncio.Event()

    def update(self, row: JobProgress | None, events: list[EventRow]) -> None:
        """Take in what was found."""
        changed = row != self.row or bool(events) or (row is None) != self.gone
        self.row, self.gone = row, row is None
        self.events += events
        if changed:
            self.notify()


class EventFeed:
    """Watches jobs while anybody wants to know of them; everything here is done by the event loop."""

    def __init__(self, jobs: Jobs, leaving: Callable[[], bool]) -> None:
        """Args:
        jobs: where they are.
        leaving: whether the service stops, so that every watcher is woken.
        """
        self._jobs = jobs
        self.leaving = leaving
        self._watched: dict[str, WatchedJob] = {}
        self._streams: Counter[Tenant] = Counter()
        self._polling: asyncio.Task[None] | None = None
        self._asked = asyncio.Event()

    @contextmanager
    def watch(self, tenant: Tenant, job_id: str) -> Iterator[WatchedJob]:
        """Watch a job of this tenant in the block; that it is the tenant's is checked before.

        Raises:
            TooManyStreams: when the tenant, or all together, watch as much as they may.
        """
        accepted = f"at most {OF_TENANT} of a tenant and {IN_ALL} in all; ask GET /v1/jobs/{job_id} instead"
        if self._streams[tenant] >= OF_TENANT:
            raise TooManyStreams("event streams", f"{OF_TENANT} of this tenant are open", accepted)
        if self._streams.total() >= IN_ALL:
            raise TooManyStreams("event streams", f"{IN_ALL} are open", accepted)
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
        # A thread of its own, which nothing else can hold.
        limiter = anyio.CapacityLimiter(1)
        try:
            while self._watched:
                self._asked.clear()
                watched = dict(self._watched)
                known = {
                    job_id: one.events[-1]["number"] if one.events else 0 for job_id, one in watched.items()
                }
                try:
                    found, events = await anyio.to_thread.run_sync(self._jobs.updates, known, limiter=limiter)
                except (SQLAlchemyError, DatabaseUnavailable) as error:
                    log.warning("jobs that are watched could not be read: %s", error)
                else:
                    for job_id, one in watched.items():
                        one.update(found.get(job_id), events.get(job_id, []))
                if self.leaving():
                    for one in self._watched.values():
                        one.notify()
                await asyncio.sleep(min(SOONEST_SECONDS, INTERVAL_SECONDS))
                with suppress(TimeoutError):
                    async with asyncio.timeout(INTERVAL_SECONDS):
                        await self._asked.wait()
        finally:
            self._polling = None

"""Job events for all event streams, polled from the database by one thread."""

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from itertools import chain
from typing import TypeVar

import anyio
from sqlalchemy.exc import SQLAlchemyError

from ..errors import DatabaseUnavailable, TooManyStreams
from ..rows.accounts import Account, Accounts
from ..rows.ids import Tenant
from ..rows.jobs import JobProgress, Jobs
from ..rows.tables import ENDED, EventRow

# Ended jobs that a tenant's streams remember, for streams that lag behind.
MAX_ENDED = 1000
# Interval between database queries, and the shorter one after a new stream was opened.
INTERVAL_SECONDS = 0.5
SOONEST_SECONDS = 0.05
# Maximum number of open streams. Each holds a connection, but no thread and no query.
OF_ACCOUNT = 64
IN_ALL = 256


class Watched:
    """Something with at least one event stream.

    Attributes:
        watchers: number of streams.
    """

    def __init__(self) -> None:
        self.watchers = 0
        self._news = asyncio.Event()

    async def wait_for_change(self, seconds: float) -> None:
        """Wait until something has changed, at most ``seconds``."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._news.wait()

    def notify(self) -> None:
        """Wake all waiting streams."""
        self._news.set()
        self._news = asyncio.Event()


class WatchedJob(Watched):
    """A job.

    Attributes:
        row: its state and progress; None before the first query.
        gone: whether it has been deleted.
        events: all its events, oldest first.
    """

    def __init__(self) -> None:
        super().__init__()
        self.row: JobProgress | None = None
        self.gone = False
        self.events: list[EventRow] = []

    def update(self, row: JobProgress | None, events: list[EventRow]) -> None:
        """Store the result of a query."""
        changed = row != self.row or bool(events) or (row is None) != self.gone
        self.row, self.gone = row, row is None
        self.events += events
        if changed:
            self.notify()


class WatchedTenant(Watched):
    """The jobs of a tenant: those that are unfinished, and those that have ended since the first query.

    Attributes:
        newest: number of the newest job at the last query; None before the first.
    """

    def __init__(self) -> None:
        super().__init__()
        self.newest: int | None = None
        # By job id, in order of the changes: number of the last change, and the job after it.
        self._changes: dict[str, tuple[int, JobProgress]] = {}
        self._serial = 0

    def unfinished(self) -> list[str]:
        """Ids of the jobs that had not ended at the last query."""
        return [name for name, (_, row) in self._changes.items() if row.state not in ENDED]

    def since(self, serial: int) -> tuple[int, list[JobProgress]]:
        """Jobs that have changed since the change ``serial``, and the number of the last change."""
        return self._serial, [row for number, row in self._changes.values() if number > serial]

    def update(self, newest: int, rows: Sequence[JobProgress]) -> None:
        """Store the result of a query."""
        self.newest, before = newest, self._serial
        for row in rows:
            if row != self._changes.get(row.id, (0, None))[1]:
                self._serial += 1
                self._changes.pop(row.id, None)
                self._changes[row.id] = self._serial, row
        found = {row.id for row in rows}
        for deleted in [name for name in self.unfinished() if name not in found]:
            del self._changes[deleted]
        ended = [name for name, (_, row) in self._changes.items() if row.state in ENDED]
        for name in ended[:-MAX_ENDED]:
            del self._changes[name]
        if self._serial != before:
            self.notify()


log = logging.getLogger("bentray.jobs")


Key = TypeVar("Key", bound=str)
Seen = TypeVar("Seen", bound=Watched)


class EventFeed:
    """Polls the watched jobs and tenants while there are any; it must be used from the event loop only."""

    def __init__(self, jobs: Jobs, accounts: Accounts, leaving: Callable[[], bool]) -> None:
        """Args:
        jobs: the table of jobs.
        accounts: whose streams are counted.
        leaving: whether the service stops; then every stream is woken.
        """
        self._jobs, self._accounts = jobs, accounts
        self.leaving = leaving
        self._watched: dict[str, WatchedJob] = {}
        self._tenants: dict[Tenant, WatchedTenant] = {}
        self._streams: Counter[Account] = Counter()
        self._polling: asyncio.Task[None] | None = None
        self._asked = asyncio.Event()

    def watch(self, tenant: Tenant, job_id: str) -> AbstractContextManager[WatchedJob]:
        """Watch a job in a ``with`` block; the caller has checked the owner.

        Raises:
            TooManyStreams: when too many streams are open, of the tenant or in total.
        """
        return self._stream(tenant, self._watched, job_id, WatchedJob, f"/v1/jobs/{job_id}")

    def watch_tenant(self, tenant: Tenant) -> AbstractContextManager[WatchedTenant]:
        """Watch all jobs of a tenant in a ``with`` block.

        Raises:
            TooManyStreams: as ``watch``.
        """
        return self._stream(tenant, self._tenants, tenant, WatchedTenant, "/v1/jobs")

    @contextmanager
    def _stream(
        self, tenant: Tenant, table: dict[Key, Seen], key: Key, kind: Callable[[], Seen], instead: str
    ) -> Iterator[Seen]:
        account = self._accounts.of(tenant)
        accepted = f"at most {OF_ACCOUNT} per tenant and {IN_ALL} in total; poll GET {instead} instead"
        if self._streams[account] >= OF_ACCOUNT:
            raise TooManyStreams("event streams", f"{OF_ACCOUNT} streams of this tenant are open", accepted)
        if self._streams.total() >= IN_ALL:
            raise TooManyStreams("event streams", f"{IN_ALL} streams are open", accepted)
        self._streams[account] += 1
        if key not in table:
            table[key] = kind()
            self._asked.set()
        watched = table[key]
        watched.watchers += 1
        if self._polling is None:
            self._polling = asyncio.create_task(self._poll())
        try:
            yield watched
        finally:
            watched.watchers -= 1
            if not watched.watchers:
                del table[key]
            self._streams[account] -= 1
            if not self._streams[account]:
                del self._streams[account]

    async def _poll(self) -> None:
        # A thread of its own, so that polling does not wait for other work.
        limiter = anyio.CapacityLimiter(1)
        try:
            while self._watched or self._tenants:
                self._asked.clear()
                try:
                    await self._poll_jobs(limiter)
                    await self._poll_tenants(limiter)
                except (SQLAlchemyError, DatabaseUnavailable) as error:
                    log.warning("watched jobs could not be read: %s", error)
                if self.leaving():
                    for one in chain(self._watched.values(), self._tenants.values()):
                        one.notify()
                await asyncio.sleep(min(SOONEST_SECONDS, INTERVAL_SECONDS))
                with suppress(TimeoutError):
                    async with asyncio.timeout(INTERVAL_SECONDS):
                        await self._asked.wait()
        finally:
            self._polling = None

    async def _poll_jobs(self, limiter: anyio.CapacityLimiter) -> None:
        watched = dict(self._watched)
        if not watched:
            return
        known = {job_id: one.events[-1].number if one.events else 0 for job_id, one in watched.items()}
        progress, events = await anyio.to_thread.run_sync(self._jobs.updates, known, limiter=limiter)
        for job_id, one in watched.items():
            one.update(progress.get(job_id), events.get(job_id, []))

    async def _poll_tenants(self, limiter: anyio.CapacityLimiter) -> None:
        for tenant, one in tuple(self._tenants.items()):
            known = one.newest, one.unfinished()
            one.update(*await anyio.to_thread.run_sync(self._jobs.changes, tenant, *known, limiter=limiter))

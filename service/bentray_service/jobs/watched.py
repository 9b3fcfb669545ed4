"""Jobs watched by event streams: one, or all of a tenant; filled by the feed, read by the streams."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress

from ..rows.jobs import JobProgress
from ..rows.tables import ENDED, EventRow

# Ended jobs that a tenant's streams remember, for streams that lag behind.
MAX_ENDED = 1000


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

"""Ages of items: the observed running time of services, and marks of items past their maximum age."""

import time
from collections.abc import Callable, Collection
from typing import NamedTuple

from sqlalchemy import delete, select

from .database import Database, Repository
from .ids import Tenant
from .tables import About, ExpiredRow


class StoredItem(NamedTuple):
    """An item to delete; ``what`` is ``dataset``, ``volume``, ``mesh``, ``job`` or ``upload``."""

    tenant: Tenant
    what: str
    id: str


class ExpiryMarks(Repository):
    """Marks expired items with the observed time, see :class:`ObservedTime`.

    Ages are computed from the system clock, which may be wrong for a while. Therefore an item is deleted only
    if it was found expired repeatedly over a period of observed time.
    """

    def mark(self, expired: Collection[StoredItem], observed_s: float) -> dict[StoredItem, float]:
        """Mark all items that are expired now, and remove the marks of items that are not.

        Args:
            expired: all expired items.
            observed_s: current observed time, s.

        Returns:
            for each item, for how long it has been found expired, s.
        """
        now = set(expired)
        with self._database.write() as session:
            rows = {
                StoredItem(row.tenant, row.what, row.id): row for row in session.scalars(select(ExpiredRow))
            }
            for item in rows.keys() - now:
                session.delete(rows[item])
            fresh = [ExpiredRow(**item._asdict(), noticed_s=observed_s) for item in now - rows.keys()]
            session.add_all(fresh)
        return {item: observed_s - rows[item].noticed_s if item in rows else 0.0 for item in now}

    def clear(self) -> None:
        """Remove all marks, after the system clock was found to be wrong."""
        self._database.change(delete(ExpiredRow))


class ObservedTime(Repository):
    """Counts the running time of services in the database, in seconds of the monotonic clock.

    With several services the count does not run faster than real time: each adds its own elapsed time to the
    count at its last call, and the largest value is stored.
    """

    def __init__(self, database: Database, clock: Callable[[], float] = time.monotonic) -> None:
        """Args:
        database: stores the count.
        clock: monotonic seconds.
        """
        super().__init__(database)
        self._clock = clock
        self._last: tuple[float, float] | None = None

    def count(self) -> float:
        """Add the time since the last call; returns the count, s."""
        with self._database.write() as session:
            about = session.scalars(select(About).with_for_update()).one()
            total = about.observed_s
            now = self._clock()
            if self._last is not None:
                counted, then = self._last
                total = max(total, counted + now - then)
            about.observed_s = total
        self._last = total, now
        return total

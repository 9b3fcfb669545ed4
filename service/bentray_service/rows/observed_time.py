"""Observed time: the total running time of services on a database, independent of the system clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from sqlalchemy import select, update

from .database import Database
from .schema import about


class ObservedTime:
    """Counts seconds of the monotonic clock in the database.

    With several services the count does not run faster than real time: each adds its own elapsed time to the
    count at its last call, and the largest value is stored.
    """

    def __init__(self, database: Database, clock: Callable[[], float] = time.monotonic) -> None:
        """Args:
        database: stores the count.
        clock: monotonic seconds.
        """
        self._database = database
        self._clock = clock
        self._last: tuple[float, float] | None = None

    def count(self) -> float:
        """Add the time since the last call; returns the count, s."""
        with self._database.write() as connection:
            total = float(connection.execute(select(about.c.observed_s).with_for_update()).scalar_one())
            now = self._clock()
            if self._last is not None:
                counted, then = self._last
                total = max(total, counted + now - then)
            connection.execute(update(about).values(observed_s=total))
        self._last = total, now
        return total

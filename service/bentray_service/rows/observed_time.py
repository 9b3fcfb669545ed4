"""How long services have been at work on a database: a clock that stops while none is, and is never set."""

from __future__ import annotations

import time
from collections.abc import Callable

from sqlalchemy import select, update

from .database import Database
from .schema import about


class ObservedTime:
    """Counts seconds in the database, by the monotonic clock; they outlive the service.

    However many services count at once, it runs no faster than time does: each adds what it saw to where the
    count stood when it looked last, and the greatest wins.
    """

    def __init__(self, database: Database, clock: Callable[[], float] = time.monotonic) -> None:
        """Args:
        database: which holds the count.
        clock: seconds that only grow.
        """
        self._database = database
        self._clock = clock
        self._last: tuple[float, float] | None = None

    def count(self) -> float:
        """Add what has passed since the last call; returns the count, s."""
        with self._database.write() as connection:
            total = float(connection.execute(select(about.c.observed_s).with_for_update()).scalar_one())
            now = self._clock()
            if self._last is not None:
                counted, then = self._last
                total = max(total, counted + now - then)
            connection.execute(update(about).values(observed_s=total))
        self._last = total, now
        return total

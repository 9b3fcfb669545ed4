"""How many threads may be at the database: while it is slow, or with very many, the next one is refused."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..refusals import DatabaseUnavailable

# The service answers requests by 40 threads: some are left for what needs no database.
MOST_AT_ONCE = 32
# How long one more waits for a place, s: all of them have ended by then while the database is well.
PLACE_SECONDS = 2.0
# Once a transaction has taken so long, s, the database is slow, and only so many may wait for it.
SLOW_SECONDS = 2.0
MOST_WHILE_SLOW = 8


class Admission:
    """Lets threads to the database, as long as they do not pile up before it.

    Args:
        clock: seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._numbers = itertools.count()
        # When each of those inside came, the oldest first.
        self._inside: dict[int, float] = {}

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """Be inside for a block.

        Raises:
            DatabaseAway: where too many are.
        """
        with self._changed:
            if self._slow() and len(self._inside) >= MOST_WHILE_SLOW:
                raise DatabaseUnavailable(f"{len(self._inside)} requests that wait for a slow database")
            if not self._changed.wait_for(lambda: len(self._inside) < MOST_AT_ONCE, PLACE_SECONDS):
                raise DatabaseUnavailable(f"{len(self._inside)} requests that wait for the database")
            number = next(self._numbers)
            self._inside[number] = self._clock()
        try:
            yield
        finally:
            with self._changed:
                del self._inside[number]
                self._changed.notify()

    def _slow(self) -> bool:
        oldest = next(iter(self._inside.values()), None)
        return oldest is not None and self._clock() - oldest > SLOW_SECONDS

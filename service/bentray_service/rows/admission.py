"""Limit on the number of threads that use the database at once; further requests are rejected."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..errors import DatabaseUnavailable

# The service answers requests with 40 threads; the rest stays free for requests without the database.
MAX_CONCURRENT = 32
# Longest wait for a place, s.
PLACE_SECONDS = 2.0
# A transaction that takes longer than this marks the database as slow; then fewer threads may wait, s.
SLOW_SECONDS = 2.0
MAX_CONCURRENT_WHEN_SLOW = 8


class Admission:
    """Limits the number of threads in database transactions."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._numbers = itertools.count()
        # Start time of each running transaction, oldest first.
        self._inside: dict[int, float] = {}

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """Take a place for the duration of the block.

        Raises:
            DatabaseUnavailable: when too many threads hold or wait for a place.
        """
        with self._changed:
            if self._slow() and len(self._inside) >= MAX_CONCURRENT_WHEN_SLOW:
                raise DatabaseUnavailable(f"{len(self._inside)} requests waiting for a slow database")
            if not self._changed.wait_for(lambda: len(self._inside) < MAX_CONCURRENT, PLACE_SECONDS):
                raise DatabaseUnavailable(f"{len(self._inside)} requests waiting for the database")
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

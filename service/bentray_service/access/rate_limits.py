"""Rate limits of accounts and addresses: a token bucket for each, with the capacity of one minute."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

# Full buckets are removed when there are this many.
MANY = 10_000


@dataclass
class _TokenBucket:
    left: float
    seen: float


class RateLimits:
    """Token buckets of accounts, or of addresses that sign in.

    Args:
        per_minute: rate limit and capacity; 0: unlimited.
        clock: seconds.
    """

    def __init__(self, per_minute: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.per_minute = per_minute
        self._clock = clock
        self._lock = threading.Lock()
        self._buckets: dict[str, _TokenBucket] = {}

    def take(self, key: str, share: float = 1.0) -> float:
        """0 if a request is allowed, else the seconds until it is; one of little work counts a share."""
        if not self.per_minute:
            return 0.0
        with self._lock:
            now = self._clock()
            if len(self._buckets) >= MANY:
                self._forget(now)
            bucket = self._buckets.setdefault(key, _TokenBucket(self.per_minute, now))
            bucket.left, bucket.seen = self._level(bucket, now), now
            if bucket.left < share:
                return (share - bucket.left) * 60.0 / self.per_minute
            bucket.left -= share
            return 0.0

    def _level(self, bucket: _TokenBucket, now: float) -> float:
        return min(float(self.per_minute), bucket.left + (now - bucket.seen) * self.per_minute / 60.0)

    def _forget(self, now: float) -> None:
        full = [name for name, bucket in self._buckets.items() if self._level(bucket, now) >= self.per_minute]
        for name in full:
            del self._buckets[name]

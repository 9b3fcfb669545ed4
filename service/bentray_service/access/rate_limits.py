"""Rate limits of accounts and addresses, counted by ``limits`` in windows of one minute."""

from __future__ import annotations

import math
import time

from limits import RateLimitItemPerMinute
from limits.storage import MemoryStorage
from limits.strategies import FixedWindowRateLimiter

# Requests of little work count in tenths.
TENTHS = 10


class RateLimits:
    """Requests of accounts, or of addresses that sign in; a minute begins with the first request.

    Not a moving window of ``limits``: its storage keeps every key for ever, and anyone may invent addresses.

    Args:
        per_minute: largest number in a minute; 0: unlimited.
    """

    def __init__(self, per_minute: int) -> None:
        self.per_minute = per_minute
        self._limiter = FixedWindowRateLimiter(MemoryStorage())
        self._limit = RateLimitItemPerMinute(per_minute * TENTHS)

    def take(self, key: str, share: float = 1.0) -> float:
        """0 if a request is allowed, else the seconds until the next minute of its account or address.

        Args:
            key: account or address.
            share: what the request counts, rounded up to tenths.
        """
        if not self.per_minute:
            return 0.0
        cost = math.ceil(share * TENTHS - 1e-9)
        # A refused request does not count, hence two calls.
        if self._limiter.test(self._limit, key, cost=cost) and self._limiter.hit(self._limit, key, cost=cost):
            return 0.0
        wait_s = self._limiter.get_window_stats(self._limit, key).reset_time - time.time()
        # The minute may have ended since.
        return max(wait_s, 1e-3)

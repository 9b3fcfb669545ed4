"""Limits of concurrent uploads and of the rate of new ones, checked before the body is read.

The largest size of an upload is ``BENTRAY_MAX_UPLOAD_BYTES`` (``settings``), checked in ``receive``.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from ..access.rate_limits import RateLimits
from ..errors import Busy, RateLimited
from ..rows.accounts import Account, Accounts
from ..rows.ids import Tenant

# Each upload has a connection and a reservation; only few are ingested at a time.
MAX_PER_ACCOUNT = 32
MAX_IN_TOTAL = 256
# New resumable uploads of an account per minute.
BEGUN_PER_MINUTE = 120
# Suggested time before the next attempt, s.
AGAIN_S = 10.0


class UploadLimits:
    """Counts one-shot uploads in progress and new resumable uploads."""

    def __init__(
        self,
        accounts: Accounts,
        of_account: int = MAX_PER_ACCOUNT,
        in_all: int = MAX_IN_TOTAL,
        begun_per_minute: int = BEGUN_PER_MINUTE,
    ) -> None:
        self._accounts = accounts
        self._of_account = of_account
        self._in_all = in_all
        self._lock = threading.Lock()
        self._there: Counter[Account] = Counter()
        self._begun = RateLimits(begun_per_minute)

    def check_begin(self, tenant: Tenant) -> None:
        """Check the rate limit of new resumable uploads.

        Raises:
            RateLimited: when it is exceeded.
        """
        wait_s = self._begun.take(self._accounts.of(tenant))
        if wait_s > 0.0:
            found = f"more than {self._begun.per_minute} new uploads per minute"
            raise RateLimited("uploads", found, "a lower rate; see Retry-After", wait_s)

    @contextmanager
    def __call__(self, tenant: Tenant) -> Iterator[None]:
        """Count an upload within the block.

        Raises:
            RateLimited: when the tenant has too many uploads in progress.
            Busy: when the service has too many uploads in progress.
        """
        account = self._accounts.of(tenant)
        with self._lock:
            own, all_of_them = self._there[account], self._there.total()
            if own >= self._of_account:
                accepted = f"at most {self._of_account} per tenant at a time; try again later"
                raise RateLimited("uploads", f"{own} in progress", accepted, AGAIN_S)
            if all_of_them >= self._in_all:
                accepted = f"at most {self._in_all} at a time; try again later"
                raise Busy("uploads", f"{all_of_them} in progress", accepted)
            self._there[account] += 1
        try:
            yield
        finally:
            with self._lock:
                self._there[account] -= 1
                if not self._there[account]:
                    del self._there[account]

"""How many uploads may be on their way, and be begun in a minute: refused before a byte is read."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from ..access.request_rates import RequestRates
from ..refusals import Busy, RateLimited
from ..rows.tenants import Tenant

# Each has a connection, and a file of which it reserved the bytes; few of them are read at a time.
MOST_OF_TENANT = 32
MOST_IN_ALL = 256
# Uploads in pieces that a tenant may begin.
BEGUN_PER_MINUTE = 120
# After which it is worth another try, s.
AGAIN_S = 10.0


class UploadLimits:
    """Counts the uploads that are received, wait, or are read, and those in pieces that are begun."""

    def __init__(
        self,
        of_tenant: int = MOST_OF_TENANT,
        in_all: int = MOST_IN_ALL,
        begun_per_minute: int = BEGUN_PER_MINUTE,
    ) -> None:
        self._of_tenant = of_tenant
        self._in_all = in_all
        self._lock = threading.Lock()
        self._there: Counter[Tenant] = Counter()
        self._begun = RequestRates(begun_per_minute)

    def check_begin(self, tenant: Tenant) -> None:
        """Refuse an upload in pieces that is begun too soon after others.

        Raises:
            TooOften: as it says.
        """
        wait_s = self._begun.take(tenant)
        if wait_s > 0.0:
            found = f"more than {self._begun.per_minute} begun in a minute"
            raise RateLimited("uploads", found, "fewer; see Retry-After", wait_s)

    @contextmanager
    def __call__(self, tenant: Tenant) -> Iterator[None]:
        """One more while the block runs.

        Raises:
            TooOften: when the tenant has as many as it may.
            Busy: when there are as many as the service takes.
        """
        with self._lock:
            own, all_of_them = self._there[tenant], self._there.total()
            if own >= self._of_tenant:
                accepted = f"at most {self._of_tenant} of a tenant at a time; try again later"
                raise RateLimited("uploads", f"{own} on their way", accepted, AGAIN_S)
            if all_of_them >= self._in_all:
                accepted = f"at most {self._in_all} at a time; try again later"
                raise Busy("uploads", f"{all_of_them} on their way", accepted)
            self._there[tenant] += 1
        try:
            yield
        finally:
            with self._lock:
                self._there[tenant] -= 1
                if not self._there[tenant]:
                    del self._there[tenant]

"""The render lane shared out: a task a worker at a time, tenants in turn, no more than can be done soon."""

from __future__ import annotations

import asyncio
import math
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from itertools import count

from bentray_workers.cluster.capacities import WorkerCapacity

from .refusals import RateLimited
from .rows.tenants import Tenant

# A picture that would be done later than this, by what is known of those before it, is refused, s.
LATEST_S = 60.0
# Pictures of a tenant, and of all of them, that are drawn or wait.
MOST_OF_TENANT, MOST_IN_ALL = 64, 256
# A task that may take longer than this leaves one worker free for shorter ones, s.
LONG_S = 3.0
# How old the list of workers may be, s; it is read anew while something waits for one.
FRESH_S = 1.0


@dataclass
class _Waiter:
    """A task that waits for a worker."""

    fits: Callable[[WorkerCapacity], bool]
    long: bool
    place: asyncio.Future[str]


class PictureQueue:
    """Which tenant's task is next, and on which worker.

    Every worker takes one task of a picture at a time, so nothing waits where it cannot be overtaken. A
    worker that becomes free goes to the tenant whose last turn is longest ago. All of it is used from one
    event loop.
    """

    def __init__(self, workers: Callable[[], Awaitable[Mapping[str, WorkerCapacity]]]) -> None:
        """Args:
        workers: gives the connected ones by address; none while the scheduler is away.
        """
        self._ask_workers = workers
        self._workers: Mapping[str, WorkerCapacity] = {}
        self._asked = -math.inf
        self._busy: dict[str, bool] = {}
        self._waiting: dict[Tenant, list[_Waiter]] = {}
        # Of tenants with a picture in hand: seconds of a core, pictures, and which turn was the last.
        self._seconds: dict[Tenant, float] = {}
        self._pictures: Counter[Tenant] = Counter()
        self._served: dict[Tenant, int] = {}
        self._turns = count(1)
        self._refreshing: asyncio.Task[None] | None = None

    async def workers(self) -> Mapping[str, WorkerCapacity]:
        """Those that are connected now, or were a moment ago, by address."""
        if time.monotonic() - self._asked > FRESH_S:
            await self._refresh()
        return self._workers

    def offer(self, address: str) -> WorkerCapacity:
        """Of a worker that was given out; of one that has left meanwhile, that of no limits."""
        return self._workers.get(address, WorkerCapacity(0, ()))

    @asynccontextmanager
    async def admitted(self, tenant: Tenant, seconds: float) -> AsyncIterator[None]:
        """One picture in hand, of so many seconds of a core.

        Raises:
            TooOften: where too many are in hand, or it would be done too late.
        """
        self._check(tenant, seconds)
        self._pictures[tenant] += 1
        self._seconds[tenant] = self._seconds.get(tenant, 0.0) + seconds
        try:
            yield
        finally:
            self._pictures[tenant] -= 1
            self._seconds[tenant] -= seconds
            if not self._pictures[tenant]:
                del self._pictures[tenant], self._seconds[tenant]
                self._served.pop(tenant, None)

    @asynccontextmanager
    async def place(
        self, tenant: Tenant, fits: Callable[[WorkerCapacity], bool], *, long: bool
    ) -> AsyncIterator[str]:
        """A worker's render lane, by the worker's address; waits until it is this task's turn.

        Args:
            tenant: whose task it is.
            fits: whether a worker can hold it.
            long: whether it may take longer than ``LONG_S``.
        """
        waiter = _Waiter(fits, long, asyncio.get_running_loop().create_future())
        self._waiting.setdefault(tenant, []).append(waiter)
        self._assign()
        if not waiter.place.done() and (self._refreshing is None or self._refreshing.done()):
            self._refreshing = asyncio.create_task(self._refresh_while_waiting())
        try:
            address = await waiter.place
        except asyncio.CancelledError:
            if waiter.place.done() and not waiter.place.cancelled():
                self._leave(waiter.place.result())
            else:
                self._forget(tenant, waiter)
            raise
        try:
            yield address
        finally:
            self._leave(address)

    def waiting(self) -> dict[Tenant, int]:
        """Tasks that wait for a worker, by tenant."""
        return {tenant: len(waiters) for tenant, waiters in self._waiting.items()}

    async def close(self) -> None:
        """Ask for no workers any more."""
        if self._refreshing is not None:
            self._refreshing.cancel()
            with suppress(asyncio.CancelledError):
                await self._refreshing

    def _check(self, tenant: Tenant, seconds: float) -> None:
        own = self._seconds.get(tenant, 0.0) + seconds
        # Those who take turns with it cannot get more than it does meanwhile.
        others = sum(min(each, own) for other, each in self._seconds.items() if other != tenant)
        late = (own + others) / max(1, len(self._workers)) - LATEST_S
        held, all_of_them = self._pictures[tenant], self._pictures.total()
        if all_of_them and late > 0.0:
            found = f"{held} pictures of this tenant in hand, {all_of_them} in all"
            accepted = f"pictures that can be drawn in about {LATEST_S:g} s; see Retry-After"
            raise RateLimited("pictures", found, accepted, min(LATEST_S, max(1.0, late)))
        if held >= MOST_OF_TENANT or all_of_them >= MOST_IN_ALL:
            found = f"{held} in hand of this tenant, {all_of_them} in all"
            accepted = f"fewer than {MOST_OF_TENANT} of a tenant and {MOST_IN_ALL} in all; see Retry-After"
            raise RateLimited("pictures", found, accepted, 1.0)

    def _assign(self) -> None:
        """Give free workers to those who wait, first to the tenant whose last turn is longest ago."""
        given = True
        while given:
            in_turn = sorted(self._waiting, key=lambda tenant: self._served.get(tenant, 0))
            given = any(self._give(tenant) for tenant in in_turn)

    def _give(self, tenant: Tenant) -> bool:
        for waiter in self._waiting[tenant]:
            # Cancelled ones are gone in a moment.
            address = None if waiter.place.done() else self._free_for(waiter)
            if address is not None:
                self._busy[address] = waiter.long
                self._served[tenant] = next(self._turns)
                self._forget(tenant, waiter)
                waiter.place.set_result(address)
                return True
        return False

    def _free_for(self, waiter: _Waiter) -> str | None:
        if waiter.long:
            most = max(1, len(self._workers) - 1)
            if sum(self._busy.values()) >= most:
                return None
        for address, offer in self._workers.items():
            if address not in self._busy and waiter.fits(offer):
                return address
        return None

    def _leave(self, address: str) -> None:
        self._busy.pop(address, None)
        self._assign()

    def _forget(self, tenant: Tenant, waiter: _Waiter) -> None:
        self._waiting[tenant].remove(waiter)
        if not self._waiting[tenant]:
            del self._waiting[tenant]

    async def _refresh(self) -> None:
        self._workers = await self._ask_workers()
        self._asked = time.monotonic()
        self._assign()

    async def _refresh_while_waiting(self) -> None:
        while self._waiting:
            await self._refresh()
            await asyncio.sleep(FRESH_S)

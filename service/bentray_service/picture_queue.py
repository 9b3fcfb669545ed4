"""The queue of rendering tasks: one task per worker at a time, tenants take turns, limited waiting time."""

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

from .errors import RateLimited
from .rows.tenants import Tenant

# Maximum estimated waiting time of a new image, s.
LATEST_S = 60.0
# Maximum number of images in progress, per tenant and in total.
MAX_PER_TENANT, MAX_IN_TOTAL = 64, 256
# One worker is kept free of tasks that may take longer than this, s.
LONG_S = 3.0
# Maximum age of the list of workers, s.
FRESH_S = 1.0


@dataclass
class _Waiter:
    """A task waiting for a worker."""

    fits: Callable[[WorkerCapacity], bool]
    long: bool
    place: asyncio.Future[str]


class PictureQueue:
    """Assigns rendering tasks to workers.

    Every worker has at most one rendering task. A free worker is assigned to the tenant served least
    recently. To be used from one event loop only.
    """

    def __init__(self, workers: Callable[[], Awaitable[Mapping[str, WorkerCapacity]]]) -> None:
        """Args:
        workers: returns the connected workers by address; none without scheduler.
        """
        self._ask_workers = workers
        self._workers: Mapping[str, WorkerCapacity] = {}
        self._asked = -math.inf
        self._busy: dict[str, bool] = {}
        self._waiting: dict[Tenant, list[_Waiter]] = {}
        # By tenant with images in progress: CPU time, number of images, last turn.
        self._seconds: dict[Tenant, float] = {}
        self._pictures: Counter[Tenant] = Counter()
        self._served: dict[Tenant, int] = {}
        self._turns = count(1)
        self._refreshing: asyncio.Task[None] | None = None

    async def workers(self) -> Mapping[str, WorkerCapacity]:
        """The connected workers by address, at most ``FRESH_S`` old."""
        if time.monotonic() - self._asked > FRESH_S:
            await self._refresh()
        return self._workers

    def offer(self, address: str) -> WorkerCapacity:
        """The capacity of a worker; unlimited for a worker that has left."""
        return self._workers.get(address, WorkerCapacity(0, ()))

    @asynccontextmanager
    async def admitted(self, tenant: Tenant, seconds: float) -> AsyncIterator[None]:
        """Admit an image with an estimated CPU time, for the duration of the block.

        Raises:
            RateLimited: when there are too many images in progress, or it would take too long.
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
        """Wait for a worker and yield its address.

        Args:
            tenant: owner of the task.
            fits: whether a worker has enough capacity.
            long: whether the task may take longer than ``LONG_S``.
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
        """Number of waiting tasks by tenant."""
        return {tenant: len(waiters) for tenant, waiters in self._waiting.items()}

    async def close(self) -> None:
        """Stop polling for workers."""
        if self._refreshing is not None:
            self._refreshing.cancel()
            with suppress(asyncio.CancelledError):
                await self._refreshing

    def _check(self, tenant: Tenant, seconds: float) -> None:
        own = self._seconds.get(tenant, 0.0) + seconds
        # Tenants take turns, so each of them delays this one by at most its own time.
        others = sum(min(each, own) for other, each in self._seconds.items() if other != tenant)
        late = (own + others) / max(1, len(self._workers)) - LATEST_S
        held, all_of_them = self._pictures[tenant], self._pictures.total()
        if all_of_them and late > 0.0:
            found = f"{held} images of this tenant in progress, {all_of_them} in total"
            accepted = f"images that can be rendered in about {LATEST_S:g} s; see Retry-After"
            raise RateLimited("pictures", found, accepted, min(LATEST_S, max(1.0, late)))
        if held >= MAX_PER_TENANT or all_of_them >= MAX_IN_TOTAL:
            found = f"{held} images of this tenant in progress, {all_of_them} in total"
            accepted = f"fewer than {MAX_PER_TENANT} per tenant and {MAX_IN_TOTAL} in total; see Retry-After"
            raise RateLimited("pictures", found, accepted, 1.0)

    def _assign(self) -> None:
        """Assign free workers to waiting tasks, first of the tenant served least recently."""
        assigned = True
        while assigned:
            in_turn = sorted(self._waiting, key=lambda tenant: self._served.get(tenant, 0))
            assigned = any(self._give(tenant) for tenant in in_turn)

    def _give(self, tenant: Tenant) -> bool:
        for waiter in self._waiting[tenant]:
            # Cancelled tasks are about to be removed.
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

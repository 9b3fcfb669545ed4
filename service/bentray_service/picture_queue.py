"""The queue of rendering tasks: one task per worker at a time, accounts take turns, limited waiting time."""

import asyncio
import math
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from itertools import count
from statistics import median
from time import monotonic

from bentray_workers.cluster.capacities import WorkerCapacity

from .errors import RateLimited
from .rows.accounts import Account

# Maximum estimated waiting time of a new image, s.
LATEST_S = 60.0
# Maximum number of images in progress, per account and in total.
MAX_PER_ACCOUNT, MAX_IN_TOTAL = 64, 256
# One worker is kept free of tasks that may take longer than this, s.
LONG_S = 3.0
# Maximum age of the list of workers, s.
FRESH_S = 1.0
# The speed of a kind of image is that of its last ones that took longer than this, s: people wait for these.
WAITED_S, LAST = 0.5, 10


@dataclass
class _Waiter:
    """A task waiting for a worker."""

    fits: Callable[[WorkerCapacity], bool]
    long: bool
    place: asyncio.Future[str]


@dataclass(eq=False)
class Picture:
    """An image in progress.

    Attributes:
        kind: images of one kind take times in proportion to their estimated CPU time.
        seconds: this estimate, s.
        begun: when a worker got its first task, s of the monotonic clock; None before.
    """

    kind: str
    seconds: float
    begun: float | None = None

    @property
    def taken(self) -> float:
        """Time since then, s."""
        return 0.0 if self.begun is None else monotonic() - self.begun


class PictureQueue:
    """Assigns rendering tasks to workers.

    Every worker has at most one rendering task. A free worker is assigned to the account served least
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
        self._waiting: dict[Account, list[_Waiter]] = {}
        # By account with images in progress: these, and its last turn.
        self._pictures: dict[Account, list[Picture]] = {}
        self._served: dict[Account, int] = {}
        # By kind: measured over estimated time.
        self._speeds: dict[str, deque[float]] = {}
        self._turns = count(1)
        self._refreshing: asyncio.Task[None] | None = None

    async def workers(self) -> Mapping[str, WorkerCapacity]:
        """The connected workers by address, at most ``FRESH_S`` old."""
        if monotonic() - self._asked > FRESH_S:
            await self._refresh()
        return self._workers

    def offer(self, address: str) -> WorkerCapacity:
        """The capacity of a worker; unlimited for a worker that has left."""
        return self._workers.get(address, WorkerCapacity(0, ()))

    @asynccontextmanager
    async def admitted(self, account: Account, seconds: float, kind: str = "") -> AsyncIterator[Picture]:
        """Admit an image with an estimated CPU time, for the duration of the block.

        Raises:
            RateLimited: when there are too many images in progress, or it would take too long.
        """
        self._check(account, seconds)
        picture = Picture(kind, seconds)
        self._pictures.setdefault(account, []).append(picture)
        try:
            yield picture
            if picture.taken > WAITED_S:
                self._speeds.setdefault(kind, deque(maxlen=LAST)).append(picture.taken / seconds)
        finally:
            self._pictures[account].remove(picture)
            if not self._pictures[account]:
                del self._pictures[account]
                self._served.pop(account, None)

    @asynccontextmanager
    async def place(
        self, account: Account, fits: Callable[[WorkerCapacity], bool], *, long: bool
    ) -> AsyncIterator[str]:
        """Wait for a worker and yield its address.

        Args:
            account: owner of the task.
            fits: whether a worker has enough capacity.
            long: whether the task may take longer than ``LONG_S``.
        """
        waiter = _Waiter(fits, long, asyncio.get_running_loop().create_future())
        self._waiting.setdefault(account, []).append(waiter)
        self._assign()
        if not waiter.place.done() and (self._refreshing is None or self._refreshing.done()):
            self._refreshing = asyncio.create_task(self._refresh_while_waiting())
        try:
            address = await waiter.place
        except asyncio.CancelledError:
            if waiter.place.done() and not waiter.place.cancelled():
                self._leave(waiter.place.result())
            else:
                self._forget(account, waiter)
            raise
        try:
            yield address
        finally:
            self._leave(address)

    def waiting(self) -> dict[Account, int]:
        """Number of waiting tasks by account."""
        return {account: len(waiters) for account, waiters in self._waiting.items()}

    @property
    def busy(self) -> int:
        """Number of workers with a rendering task."""
        return len(self._busy)

    def left_s(self, account: Account) -> float | None:
        """Estimated time until the images of an account in progress are ready, s.

        None while the speed of one of their kinds is not measured, and once this time has passed.
        """
        if any(picture.kind not in self._speeds for each in self._pictures.values() for picture in each):
            return None
        left = {
            other: [max(0.0, median(self._speeds[one.kind]) * one.seconds - one.taken) for one in pictures]
            for other, pictures in self._pictures.items()
        }
        own = left.pop(account, [])
        # Accounts take turns.
        whole = sum(own) + sum(min(sum(each), sum(own)) for each in left.values())
        return max(*own, whole / max(1, len(self._workers)), 0.0) or None

    async def close(self) -> None:
        """Stop polling for workers."""
        if self._refreshing is not None:
            self._refreshing.cancel()
            with suppress(asyncio.CancelledError):
                await self._refreshing

    def _check(self, account: Account, seconds: float) -> None:
        all_seconds = {other: sum(one.seconds for one in each) for other, each in self._pictures.items()}
        own = all_seconds.pop(account, 0.0) + seconds
        # Accounts take turns, so each of them delays this one by at most its own time.
        others = sum(min(each, own) for each in all_seconds.values())
        late = (own + others) / max(1, len(self._workers)) - LATEST_S
        held, all_of_them = len(self._pictures.get(account, ())), sum(map(len, self._pictures.values()))
        if all_of_them and late > 0.0:
            given = f"{held} images of this tenant in progress, {all_of_them} in total"
            accepted = f"images that can be rendered in about {LATEST_S:g} s; see Retry-After"
            raise RateLimited("pictures", given, accepted, min(LATEST_S, max(1.0, late)))
        if held >= MAX_PER_ACCOUNT or all_of_them >= MAX_IN_TOTAL:
            given = f"{held} images of this tenant in progress, {all_of_them} in total"
            accepted = f"fewer than {MAX_PER_ACCOUNT} per tenant and {MAX_IN_TOTAL} in total; see Retry-After"
            raise RateLimited("pictures", given, accepted, 1.0)

    def _assign(self) -> None:
        """Assign free workers to waiting tasks, first of the account served least recently."""
        assigned = True
        while assigned:
            in_turn = sorted(self._waiting, key=lambda account: self._served.get(account, 0))
            assigned = any(self._give(account) for account in in_turn)

    def _give(self, account: Account) -> bool:
        for waiter in self._waiting[account]:
            # Cancelled tasks are about to be removed.
            address = None if waiter.place.done() else self._free_for(waiter)
            if address is not None:
                self._busy[address] = waiter.long
                self._served[account] = next(self._turns)
                self._forget(account, waiter)
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

    def _forget(self, account: Account, waiter: _Waiter) -> None:
        self._waiting[account].remove(waiter)
        if not self._waiting[account]:
            del self._waiting[account]

    async def _refresh(self) -> None:
        self._workers = await self._ask_workers()
        self._asked = monotonic()
        self._assign()

    async def _refresh_while_waiting(self) -> None:
        while self._waiting:
            await self._refresh()
            await asyncio.sleep(FRESH_S)

"""The ingest queue: accounts take turns; uploads of one account are processed in order."""

import threading
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from dask.system import CPU_COUNT
from distributed.system import MEMORY_LIMIT

from ..rows.accounts import Account, Accounts
from ..rows.ids import Tenant

# Minimum number of threads, so that one account cannot occupy all of them.
MIN_CONCURRENT = 3
STOP_SECONDS = 30.0


def readers_at_once(memory_bytes: int) -> int:
    """Number of concurrent ingest processes with ``memory_bytes`` each on this machine.

    They use at most half of the memory, unless that allows less than the minimum number.
    """
    return max(MIN_CONCURRENT, min(int(CPU_COUNT), int(MEMORY_LIMIT) // (2 * memory_bytes)))


@dataclass(frozen=True, eq=False)
class _QueuedRead:
    work: Callable[[], Any]
    future: Future[Any]


class FairQueue:
    """Runs up to ``at_once`` functions in threads.

    The next account is the one with the fewest running functions, then the one served least recently. One
    thread is reserved for other accounts, so that a single one cannot block the queue.

    Attributes:
        share: maximum number of running functions per account.
    """

    def __init__(self, at_once: int, accounts: Accounts) -> None:
        self._accounts = accounts
        self.share = max(1, at_once - 1)
        self._waiting: dict[Account, deque[_QueuedRead]] = {}
        # Turn in which each account was served last.
        self._served: Counter[Account] = Counter()
        self._turn = 0
        self._working: Counter[Account] = Counter()
        self._changed = threading.Condition()
        self._leaving = False
        self._threads = [
            threading.Thread(target=self._loop, name=f"ingest-{i}", daemon=True) for i in range(at_once)
        ]

    def start(self) -> None:
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Cancel queued functions, and end the threads after the running ones."""
        with self._changed:
            self._leaving = True
            waiting = [task.future for tasks in self._waiting.values() for task in tasks]
            self._changed.notify_all()
        for future in waiting:
            future.cancel()
        for thread in self._threads:
            thread.join(STOP_SECONDS)

    def submit(self, tenant: Tenant, work: Callable[[], Any]) -> Future[Any]:
        """Queue a function for a tenant; cancelling the future removes it from the queue."""
        task, account = _QueuedRead(work, Future()), self._accounts.of(tenant)
        with self._changed:
            self._waiting.setdefault(account, deque()).append(task)
            self._changed.notify()
        task.future.add_done_callback(
            lambda future: self._leave(account, task) if future.cancelled() else None
        )
        return task.future

    def waiting(self, tenant: Tenant) -> int:
        """Number of queued functions of the account of a tenant."""
        account = self._accounts.of(tenant)
        with self._changed:
            return len(self._waiting.get(account, ()))

    def _leave(self, account: Account, task: _QueuedRead) -> None:
        with self._changed:
            tasks = self._waiting.get(account)
            if tasks is not None and task in tasks:
                tasks.remove(task)
                if not tasks:
                    del self._waiting[account]

    def _loop(self) -> None:
        while True:
            with self._changed:
                while (taken := self._take()) is None and not self._leaving:
                    self._changed.wait()
            if taken is None:
                return
            account, task = taken
            if task.future.set_running_or_notify_cancel():
                try:
                    result = task.work()
                except BaseException as error:
                    task.future.set_exception(error)
                else:
                    task.future.set_result(result)
            with self._changed:
                self._working[account] -= 1
                # Another thread may have skipped this account.
                self._changed.notify_all()

    def _take(self) -> tuple[Account, _QueuedRead] | None:
        """Take the next function from the queue."""
        able = [account for account in self._waiting if self._working[account] < self.share]
        if self._leaving or not able:
            return None
        account = min(able, key=lambda one: (self._working[one], self._served[one]))
        task = self._waiting[account].popleft()
        if not self._waiting[account]:
            del self._waiting[account]
        self._working[account] += 1
        self._turn += 1
        self._served[account] = self._turn
        return account, task

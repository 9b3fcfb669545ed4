"""What a process keeps to use again: values by key, dropped when memory is needed for something else."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from itertools import count
from threading import RLock
from typing import Any, NamedTuple
from weakref import WeakSet

from .capacities import Offer

# Of a worker's memory, what may be kept while it does something else than drawing. Jobs are planned for 80 %
# of it, and Dask kills at 95 %.
LEFT_PART = 0.05

# One lock for all: what is made for one store makes room in the others.
_MAKING = RLock()
_STORES: WeakSet[Kept] = WeakSet()
_CLOCK = count()


class _Value(NamedTuple):
    value: Any
    size: int
    used: int


class Kept:
    """Values by key, the least lately used ones dropped to stay below so many bytes.

    A value is made with the lock held: two tasks that want the same large one must not make it twice.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._values: OrderedDict[Hashable, _Value] = OrderedDict()
        _STORES.add(self)

    def get(self, key: Hashable, size: int, make: Callable[[], Any], making: int = 0) -> Any:
        """The value of ``key``, made if it is not there.

        Args:
            key: of it.
            size: of it, bytes; these are made free before.
            make: makes it.
            making: bytes that there are at once while it is made, itself among them, if more than ``size``.
                A worker drops for them what was used longest ago in any store.
        """
        with _MAKING:
            if key in self._values:
                found = self._values.pop(key)
                self._values[key] = found._replace(used=next(_CLOCK))
                return found.value
            while self._values and self.held() + size > self._most:
                self._values.popitem(last=False)
            make_room(_ROOM.task_bytes - max(size, making))
            value = make()
            if size <= self._most:
                self._values[key] = _Value(value, size, next(_CLOCK))
            return value

    def held(self) -> int:
        """Bytes of all values."""
        return sum(value.size for value in self._values.values())

    def oldest(self) -> float:
        """When the first value to be dropped was used last; infinite where there is none."""
        return next((value.used for value in self._values.values()), math.inf)

    def drop_oldest(self) -> None:
        """Drop that value."""
        self._values.popitem(last=False)


class _Room:
    """Of a process that is a worker: bytes for one task, and those that may stay kept beside one of a job."""

    task_bytes = math.inf
    left_bytes = math.inf


_ROOM = _Room()


def limit(memory_bytes: int) -> None:
    """Tell that this process is a worker with so much memory, bytes; 0: without a limit."""
    _ROOM.task_bytes = Offer(memory_bytes, ()).task_bytes
    _ROOM.left_bytes = LEFT_PART * memory_bytes if memory_bytes else math.inf


def make_room(most_bytes: float) -> None:
    """Drop values of all stores, those used longest ago first, until so many bytes are left at most."""
    with _MAKING:
        while sum(store.held() for store in _STORES) > most_bytes:
            oldest = min(_STORES, key=Kept.oldest)
            if oldest.oldest() == math.inf:
                return
            oldest.drop_oldest()


def leave_room() -> None:
    """Before a call of a job, which is planned as if no picture had been drawn: keep little."""
    if _ROOM.left_bytes < math.inf:
        make_room(_ROOM.left_bytes)

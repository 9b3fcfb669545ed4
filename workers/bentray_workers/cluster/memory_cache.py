"""Memory cache of a process: values by key, evicted when the memory is needed for other work."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from itertools import count
from threading import RLock
from typing import Any, NamedTuple
from weakref import WeakSet

from .capacities import WorkerCapacity

# Part of the memory of a worker that may stay cached during tasks that do not draw. Jobs are planned for 80 %
# of the memory, and Dask kills a worker at 95 %.
LEFT_PART = 0.05

# One lock for all caches: a new value of one evicts values of the others.
_LOCK = RLock()
_CACHES: WeakSet[MemoryCache] = WeakSet()
_CLOCK = count()


class _Value(NamedTuple):
    value: Any
    size: int
    used: int


class MemoryCache:
    """Values by key within a limit of bytes; the least recently used ones are evicted.

    A value is made with the lock held, so that two tasks never make the same large value twice.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._values: OrderedDict[Hashable, _Value] = OrderedDict()
        _CACHES.add(self)

    def get(self, key: Hashable, size: int, make: Callable[[], Any], making: int = 0) -> Any:
        """The value of ``key``, made if it is not cached.

        Args:
            key: of the value.
            size: of the value, bytes; as many are evicted before.
            make: makes the value.
            making: peak memory while the value is made, bytes, if more than ``size``. A worker evicts the
                least recently used values of any cache for it.
        """
        with _LOCK:
            if key in self._values:
                cached = self._values.pop(key)
                self._values[key] = cached._replace(used=next(_CLOCK))
                return cached.value
            while self._values and self.held() + size > self._most:
                self._values.popitem(last=False)
            evict_to(_LIMITS.task_bytes - max(size, making))
            value = make()
            if size <= self._most:
                self._values[key] = _Value(value, size, next(_CLOCK))
            return value

    def held(self) -> int:
        """Bytes of all values."""
        return sum(value.size for value in self._values.values())

    def oldest(self) -> float:
        """Last use of the least recently used value; infinite without values."""
        return next((value.used for value in self._values.values()), math.inf)

    def drop_oldest(self) -> None:
        """Evict that value."""
        self._values.popitem(last=False)


class _Limits:
    """Memory of a worker process: for one task, and for values cached beside a task of a job."""

    task_bytes = math.inf
    cached_bytes = math.inf


_LIMITS = _Limits()


def set_memory_limit(memory_bytes: int) -> None:
    """Set the memory of this worker process, bytes; 0: no limit."""
    _LIMITS.task_bytes = WorkerCapacity(memory_bytes, ()).task_bytes
    _LIMITS.cached_bytes = LEFT_PART * memory_bytes if memory_bytes else math.inf


def evict_to(most_bytes: float) -> None:
    """Evict the least recently used values of all caches until at most so many bytes are left."""
    with _LOCK:
        while sum(cache.held() for cache in _CACHES) > most_bytes:
            oldest = min(_CACHES, key=MemoryCache.oldest)
            if oldest.oldest() == math.inf:
                return
            oldest.drop_oldest()


def evict_for_job() -> None:
    """Before a task of a job, which is planned without cached values: evict most of them."""
    if _LIMITS.cached_bytes < math.inf:
        evict_to(_LIMITS.cached_bytes)

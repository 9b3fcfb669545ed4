"""Threads that share the planes of one grid; compiled kernels and NumPy release the GIL."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats


@dataclass(frozen=True)
class ThreadTeam:
    """Threads, and the ``map`` that runs one call on each of them at the same time."""

    threads: int = 1
    at_once: Callable[..., Iterable[Any]] = map

    def map_blocks(self, function: Callable[[int, int], None], planes: int, min_planes: int) -> None:
        """Call ``function(first, end)`` for adjacent blocks of ``min_planes`` or more, one a thread."""
        parts = max(1, min(self.threads, planes // min_planes))
        cuts = [planes * part // parts for part in range(parts + 1)]
        list(self.at_once(function, cuts[:-1], cuts[1:]))

    def fill(self, array: Floats, value: float) -> None:
        """Fill a flat array; the first writing of memory, for which the system clears it, is shared too."""
        self.map_blocks(lambda first, end: array[first:end].fill(value), array.size, 1)

    def copy(self, source: Floats, into: Floats) -> None:
        """Copy a flat array."""
        self.map_blocks(lambda first, end: np.copyto(into[first:end], source[first:end]), into.size, 1)


SINGLE_THREAD = ThreadTeam()


@contextmanager
def thread_team(threads: int) -> Iterator[ThreadTeam]:
    """That many threads, which end with the block."""
    if threads == 1:
        yield SINGLE_THREAD
        return
    with ThreadPoolExecutor(threads, "sweep") as pool:
        yield ThreadTeam(threads, pool.map)

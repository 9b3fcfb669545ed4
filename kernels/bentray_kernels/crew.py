"""Threads that share the planes of one grid; compiled kernels and NumPy release the GIL."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Floats


@dataclass(frozen=True)
class Crew:
    """Threads, and the ``map`` that runs one call on each of them at the same time."""

    threads: int = 1
    at_once: Callable[..., Iterable[Any]] = map

    def share(self, work: Callable[[int, int], None], planes: int, least: int) -> None:
        """Call ``work(first, end)`` for adjacent groups of at least ``least`` planes, one for each thread."""
        parts = max(1, min(self.threads, planes // least))
        cuts = [planes * part // parts for part in range(parts + 1)]
        list(self.at_once(work, cuts[:-1], cuts[1:]))

    def fill(self, array: Floats, value: float) -> None:
        """Fill a flat array; the first writing of memory, for which the system clears it, is shared too."""
        self.share(lambda first, end: array[first:end].fill(value), array.size, 1)

    def copy(self, source: Floats, into: Floats) -> None:
        """Copy a flat array."""
        self.share(lambda first, end: np.copyto(into[first:end], source[first:end]), into.size, 1)


ALONE = Crew()


@contextmanager
def crew_of(threads: int) -> Iterator[Crew]:
    """That many threads, which end with the block."""
    if threads == 1:
        yield ALONE
        return
    with ThreadPoolExecutor(threads, "sweep") as pool:
        yield Crew(threads, pool.map)

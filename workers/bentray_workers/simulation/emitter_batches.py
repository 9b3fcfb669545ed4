"""Simulated scans cut into batches of emitters, shared out over a cluster or over this machine's cores."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Protocol

import numpy as np
from distributed import Client, as_completed

from bentray_kernels.acquisition.simulation.fine_medium import FineMedium
from bentray_kernels.arrays import Floats, Ints

from ..cluster.resources import RECONSTRUCTION

# Emitters a task: about a second of work on the default grid.
BATCH = 8

Batch = tuple[int, Ints]
Arrivals = tuple[Floats, Floats | None]


class Scans(Protocol):
    """One or several scans to simulate, numbered from 0; hashable, and small enough to send with a task."""

    def __hash__(self) -> int: ...

    def medium_number(self, scan: int) -> int:
        """Which medium a scan goes through; scans may share one."""
        ...

    def medium(self, number: int) -> FineMedium:
        """A medium by its number."""
        ...

    def elements_in_medium(self, scan: int) -> Floats:
        """(n, ndim), m, in the medium's coordinates."""
        ...


def arrivals(
    client: Client | None, settings: Scans, scans: int, emitters: int
) -> Iterator[tuple[Batch, Arrivals]]:
    """What every element receives, batch by batch, in no order that holds.

    Args:
        client: of a cluster; None uses the cores of this machine.
        settings: which scans.
        scans: how many; each has as many ``emitters``.

    Yields:
        (scan, emitters), and what ``FineMedium.arrivals`` gives for them.
    """
    parts = np.array_split(np.arange(emitters), -(-emitters // BATCH))
    batches = [(scan, part) for scan in range(scans) for part in parts]
    if client is None:
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            for scan in range(scans):
                # Sampled once, before the threads would each do it.
                _medium(settings, settings.medium_number(scan))
                own = [batch for batch in batches if batch[0] == scan]
                yield from zip(
                    own, pool.map(lambda batch: simulate_emitters(settings, *batch), own), strict=True
                )
        return
    futures = {
        client.submit(simulate_emitters, settings, *batch, resources=RECONSTRUCTION, pure=False): batch
        for batch in batches
    }
    for future, received in as_completed(futures, loop=client.loop, with_results=True):
        yield futures[future], received


def simulate_emitters(settings: Scans, scan: int, emitters: Ints) -> Arrivals:
    """Task: what the elements receive from some emitters of one scan."""
    medium = _medium(settings, settings.medium_number(scan))
    return medium.arrivals(settings.elements_in_medium(scan), emitters)


@lru_cache(maxsize=2)
def _medium(settings: Scans, number: int) -> FineMedium:
    return settings.medium(number)

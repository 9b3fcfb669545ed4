"""The hostile list against a service, itself and behind nginx."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_workers.files.dataset import write_dataset

from .attack_table import Outcome, run
from .service_attacks import Victim, service_attacks

ELEMENTS = 32


def _scan() -> Dataset:
    """A phantom in water, as for the tests of faults."""
    ring, emitters = Ring(ELEMENTS, 0.08), np.arange(ELEMENTS)
    delta = TravelTimeScan(table6(1500.0), ring, TABLE6_SIDE_M, nodes=64).delta_tof(emitters)
    return Dataset(ring.positions(), emitters, emitters, 1500.0, delta_tof_s=delta)


def _on_service(folder: Path, say: Callable[[str], None], *, fronted: bool = False) -> list[Outcome]:
    write_dataset(folder / "scan.h5", _scan())
    victim = Victim(folder, fronted=fronted)
    try:
        return run(service_attacks(victim, (folder / "scan.h5").read_bytes()), say)
    finally:
        victim.close()


LISTS = {"service": _on_service, "edge": partial(_on_service, fronted=True)}


def run_list(name: str, folder: Path, say: Callable[[str], None]) -> list[Outcome]:
    """Try one part in an empty folder.

    Args:
        name: a key of ``LISTS``.
        folder: for data and logs.
        say: called with a line after each attack.
    """
    return LISTS[name](folder, say)

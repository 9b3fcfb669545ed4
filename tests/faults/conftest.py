"""Fixtures of the fault tests: a scan, and a deployment whose parts can be killed."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_workers.files.dataset import write_dataset

from .machine import Machine

ELEMENTS = 32


@pytest.fixture(scope="session")
def scan() -> Dataset:
    """A phantom in water, with noise-free times."""
    ring, emitters = Ring(ELEMENTS, 0.08), np.arange(ELEMENTS)
    delta = TravelTimeScan(table6(1500.0), ring, TABLE6_SIDE_M, nodes=64).delta_tof(emitters)
    return Dataset(ring.positions(), emitters, emitters, 1500.0, delta_tof_s=delta)


@pytest.fixture(scope="session")
def scan_file(scan: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scan as a file."""
    path = tmp_path_factory.mktemp("scan") / "scan.h5"
    write_dataset(path, scan)
    return path


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    """A scheduler, two workers and a service, for all tests of a file: each leaves them at work."""
    made = Machine(tmp_path_factory.mktemp("machine"))
    try:
        made.wait_ready()
        yield made
    finally:
        made.close()

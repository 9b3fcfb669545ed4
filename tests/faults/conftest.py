"""Fixtures of the fault tests: a scan, and a deployment whose parts can be killed."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from bentray_kernels.acquisition import Dataset
from bentray_workers.files.dataset import write_dataset

from ..table6 import table6_scan
from .machine import Machine

ELEMENTS = 32


@pytest.fixture(scope="session")
def scan() -> Dataset:
    """A phantom in water, with noise-free times."""
    return table6_scan(ELEMENTS, 64, 0.08, 1500.0)


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

"""One small cluster in this process for all worker tests, and a small scan."""

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset import write_dataset


@pytest.fixture(scope="session")
def cluster(tmp_path_factory):
    with open_cluster(workers=2, local_directory=tmp_path_factory.mktemp("dask"), processes=False) as cluster:
        yield cluster


@pytest.fixture
def scan():
    """Three slices of smooth made-up delays: enough to reconstruct, nothing to admire."""
    ring = Ring(24, 0.08)
    angle = np.arange(24) * 2 * np.pi / 24
    chord = np.sin(0.5 * (angle[:, None] - angle[None, :])) ** 2
    everyone = np.arange(24)
    return Dataset(
        ring.positions(),
        everyone,
        everyone,
        1500.0,
        delta_tof_s=-1e-6 * chord * np.array([1.0, 0.5, 0.2])[:, None, None],
        slice_z_m=np.array([0.0, 0.003, 0.006]),
    )


@pytest.fixture
def path(scan, tmp_path):
    """File of the scan of a test."""
    target = tmp_path / "scan.h5"
    write_dataset(target, scan)
    return target

"""Capacities of workers: memory, resources, and OpenCL only where a device passed its self-test."""

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_workers.cluster import capacities
from bentray_workers.cluster.capacities import MIB
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.cluster.resources import OPENCL
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction import reconstruction_run

WITH_DEVICE = Settings(method="sart", nodes=16, iterations=1, device="opencl")


@pytest.fixture
def fresh(tmp_path):
    """Workers that no test has asked for a device before."""
    with open_cluster(workers=1, local_directory=tmp_path, processes=False) as cluster:
        yield cluster.client


def lanes(client):
    return {lane for offer in capacities.capacities_of(client) for lane in offer.resources}


def test_memory_and_resources_are_reported(cluster):
    workers = capacities.capacities_of(cluster.client)
    assert len(workers) == 2
    assert {"recon", "render"} <= set(workers[0].resources)
    assert workers[0].memory_bytes >= 0


def test_devices_are_tested_only_on_request(fresh, monkeypatch):
    monkeypatch.setattr(capacities, "_has_device", lambda: pytest.fail("tried"))
    assert capacities.resources_for(fresh, Settings(method="sart")) == {"recon": 1}
    assert lanes(fresh) == {"recon", "render", "short", "drawing"}


def test_without_a_device_one_is_rejected(fresh, monkeypatch):
    monkeypatch.setattr(capacities, "_has_device", lambda: False)
    with pytest.raises(InvalidInput, match="eikonal: found 'fim-opencl', which no connected worker has"):
        capacities.resources_for(fresh, Settings(method="sart", eikonal="fim-opencl"))
    for settings in (WITH_DEVICE, Settings(method="waveform", device="opencl")):
        with pytest.raises(InvalidInput, match="device: found 'opencl', which no connected worker has"):
            capacities.resources_for(fresh, settings)
    assert "opencl" not in lanes(fresh)


def test_a_device_is_offered_once_it_has_passed(fresh, monkeypatch):
    asked = []
    monkeypatch.setattr(capacities, "_has_device", lambda: not asked.append(None))
    for _ in range(2):
        assert capacities.resources_for(fresh, WITH_DEVICE) == {"recon": 1, "opencl": 1}
    assert len(asked) == 1
    assert "opencl" in lanes(fresh)
    assert fresh.submit(sum, [1, 2], resources=OPENCL).result(10) == 3


def test_external_cluster_is_not_queried(fresh, monkeypatch):
    monkeypatch.setattr(capacities, "_has_device", lambda: pytest.fail("tried"))
    with open_cluster(fresh.scheduler.address) as joined, pytest.raises(InvalidInput, match="device"):
        capacities.resources_for(joined.client, WITH_DEVICE)


@pytest.mark.opencl
def test_the_memory_of_a_device_is_known_to_plans(fresh, opencl_session):
    capacities.resources_for(fresh, WITH_DEVICE)
    (workers,) = capacities.capacities_of(fresh)
    assert set(workers.resources) == {*OPENCL, "recon", "render", "short", "drawing"}
    assert workers.device_bytes == opencl_session.device.memory_bytes // MIB * MIB > 0


@pytest.mark.opencl
def test_a_reconstruction_runs_on_the_device_lane(fresh, scan, tmp_path):
    path = tmp_path / "scan.h5"
    write_dataset(path, scan)
    result = reconstruction_run.reconstruct(fresh, path, WITH_DEVICE)
    assert (result.speed == reconstruct_here(scan, WITH_DEVICE).speed).all()

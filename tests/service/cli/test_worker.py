"""`bentray worker`: joins a scheduler, works, reconnects, and stops on a signal."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

from bentray_kernels.tomography import Settings
from bentray_service.healthcheck import check_worker
from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.reconstruction.reconstruction_run import reconstruct

from ...free_ports import free_port
from ...listening import beyond_loopback, listening, pages
from ...waiting import wait_until
from .conftest import Run

PATIENCE_S = 240.0
Process = subprocess.Popen[str]


def start_scheduler(port: int) -> Process:
    command = ["dask", "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    environment = {**os.environ, "DASK_DISTRIBUTED__SCHEDULER__HTTP__ROUTES": "[]"}
    return subprocess.Popen(
        [sys.executable, "-m", *command], env=environment, text=True, stderr=subprocess.DEVNULL
    )


def wait_for_workers(cluster: Cluster, count: int) -> None:
    wait_until(lambda: cluster.describe()["workers"] == count, PATIENCE_S)


class Machine:
    """A scheduler and a worker of this machine, each a process."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.log = folder / "worker.log"
        self.scheduler = start_scheduler(self.port)
        self.address = f"tcp://127.0.0.1:{self.port}"
        self._join(folder)

    def _join(self, folder: Path) -> None:
        with open_cluster(self.address, connect_timeout_s=60.0):
            words = ["--scheduler", self.address, "--workers", "1", "--no-opencl", "--name", "away", "--json"]
            command = [sys.executable, "-m", "bentray_service.cli", "worker", *words]
            command += ["--memory-limit", "2GiB", "--local-directory", str(folder / "scratch")]
            with self.log.open("w") as log:
                self.worker: Process = subprocess.Popen(
                    command, text=True, stdout=subprocess.PIPE, stderr=log
                )

    def close(self) -> None:
        for process in (self.worker, self.scheduler):
            process.kill()
            process.wait()
        assert self.worker.stdout is not None
        self.worker.stdout.close()


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    result = Machine(tmp_path_factory.mktemp("machine"))
    yield result
    result.close()


@pytest.mark.slow
@pytest.mark.nightly
def test_it_joins_works_comes_back_and_leaves(machine: Machine, scan_file: Path) -> None:
    settings = Settings(method="sart", nodes=32, iterations=1)
    with open_cluster(machine.address) as cluster:
        wait_for_workers(cluster, 1)
        (facts,) = cluster.client.scheduler_info(n_workers=-1)["workers"].values()
        assert (facts["name"], facts["nthreads"], facts["memory_limit"]) == ("away", 4, 2 * 1024**3)
        assert facts["resources"] == {"recon": 1, "drawing": 1, "render": 1, "short": 1}
        there = reconstruct(cluster.client, scan_file, settings)
    np.testing.assert_array_equal(there.speed, reconstruct(None, scan_file, settings).speed)

    wait_until(lambda: check_worker(machine.address) is None, PATIENCE_S)
    sockets = listening(machine.worker.pid)
    assert (beyond_loopback(sockets), pages(sockets)) == (set(), [])

    machine.scheduler.kill()
    machine.scheduler.wait()
    machine.scheduler = start_scheduler(machine.port)
    with open_cluster(machine.address, connect_timeout_s=60.0) as cluster:
        wait_for_workers(cluster, 1)
        assert cluster.client.submit(sum, [1, 2]).result(timeout=60) == 3

    wait_until(lambda: machine.log.read_text().count(f"1 workers joined {machine.address}") == 2, PATIENCE_S)
    family = psutil.Process(machine.worker.pid).children(recursive=True)
    assert family
    machine.worker.send_signal(signal.SIGTERM)
    assert machine.worker.wait(60.0) == 0
    psutil.wait_procs(family, timeout=60.0)
    assert [process for process in family if process.is_running()] == []
    assert (check_worker(machine.address) or "").endswith("none so far")
    assert machine.worker.stdout is not None
    assert json.loads(machine.worker.stdout.readline()) == {
        "scheduler": machine.address,
        "workers": 1,
        "lanes": {"recon": 1, "drawing": 1, "render": 1, "short": 1},
        "pid": machine.worker.pid,
    }
    said = machine.log.read_text()
    assert f"{machine.address} is gone; trying again." in said
    assert "never retrieved" not in said


def test_the_lane_of_opencl_is_offered_where_a_device_passed(
    bentray: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bentray_kernels import opencl
    from bentray_workers.cluster import local_workers

    asked: list[local_workers.JoinRequest] = []
    monkeypatch.setattr(local_workers, "join", lambda joined, say: asked.append(joined))
    device = opencl.Device(0, "PoCL", "cpu", "cpu", "", "", True)
    for result in (device, None):
        monkeypatch.setattr(opencl, "select_device", lambda found=result: opencl.DeviceSelection(found, ()))
        bentray("worker", "--scheduler", "tcp://head:8786", "--workers", 3)
    assert [dict(request.resources) for request in asked] == [
        {"recon": 1, "drawing": 1, "render": 1, "short": 1, "opencl": 1},
        {"recon": 1, "drawing": 1, "render": 1, "short": 1},
    ]
    assert asked[0].workers == 3

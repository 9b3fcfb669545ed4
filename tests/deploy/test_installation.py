"""The installation of docker-compose.yml, as processes: it works, and again after any part was killed."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.tomography import Settings
from bentray_service.client import Client
from bentray_service.healthcheck import check_scheduler
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.reconstruction import read_reconstruction
from bentray_workers.reconstruction.reconstruction_run import reconstruct
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate

from .. import postgresql
from ..listening import beyond_loopback, listening, pages
from ..waiting import wait_until
from . import compose
from .installation import PARTS, Installation

pytestmark = [
    pytest.mark.slow,
    pytest.mark.nightly,
    pytest.mark.skipif(postgresql.programs() is None, reason=postgresql.SKIPPED),
]

QUICK = Settings(method="sart", nodes=32, iterations=1)
# Some seconds of work, to be in the middle of when something dies.
LONG = Settings(method="sart", nodes=64, iterations=80, rays="straight")


@pytest.fixture(scope="module")
def installation(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installation]:
    result = Installation(tmp_path_factory.mktemp("installation"))
    try:
        for part in PARTS:
            result.start(part)
            result.wait_for(part)
        yield result
    finally:
        result.close()


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scan") / "scan.h5"
    write_dataset(path, simulate(SimulationSettings(nodes=32, elements=24, coupling_mps=1375.0)))
    return path


def test_a_scan_is_uploaded_and_reconstructed(installation: Installation, scan: Path, tmp_path: Path) -> None:
    with Client(installation.url, key=installation.key) as client:
        job = client.submit(client.upload(scan).id, QUICK.to_dict())
        job = client.wait(job.id)
        client.download(job.volume, "hdf5", tmp_path / "result.h5")
    here = reconstruct(None, scan, QUICK)
    np.testing.assert_array_equal(read_reconstruction(tmp_path / "result.h5").speed, here.speed)


def test_the_database_is_really_used_and_the_password_is_in_no_command(installation: Installation) -> None:
    assert not list((installation.folder / "data").glob("*.sqlite*"))
    for part in PARTS[1:]:
        words = " ".join(installation.words(installation.services[part]["command"]))
        assert installation.database.password not in words + str(installation.environment(part))


@pytest.mark.parametrize("part", PARTS[1:])
def test_no_page_of_dask_is_shown(installation: Installation, part: str) -> None:
    sockets = listening(installation.pid(part))
    assert sockets
    assert beyond_loopback(sockets) == set()
    if part != "service":
        assert pages(sockets) == []


@pytest.mark.parametrize("part", ["worker", "service", "scheduler", "database"])
def test_it_works_again_after_a_part_was_killed(installation: Installation, scan: Path, part: str) -> None:
    with Client(installation.url, key=installation.key) as client:
        job = client.submit(client.upload(scan).id, LONG.to_dict())
        wait_until(lambda: client.job(job.id).progress.done > 0)
        assert client.job(job.id).state == "running", "it must be in the middle of it"
    installation.kill(part)
    assert not installation.healthy(part)
    installation.start(part)
    for each in PARTS:
        installation.wait_for(each)
    with Client(installation.url, key=installation.key) as client:
        # What was under way when the part died is finished too.
        assert client.wait(job.id).state == "succeeded", installation.log("service")
        again = client.submit(client.upload(scan).id, QUICK.to_dict())
        assert client.wait(again.id).state == "succeeded"


def test_parts_accept_only_tls_with_certificates(tmp_path: Path, scan: Path) -> None:
    subprocess.run([str(compose.ROOT / "deploy" / "certificates.sh"), str(tmp_path / "tls")], check=True)
    secured = Installation(tmp_path, compose.TLS)
    try:
        for part in PARTS:
            secured.start(part)
            secured.wait_for(part)
        address = f"127.0.0.1:{secured.ports['scheduler']}"
        assert check_scheduler(f"tcp://{address}") is not None, "nobody is answered without TLS"
        with Client(secured.url, key=secured.key) as client:
            job = client.submit(client.upload(scan).id, QUICK.to_dict())
            assert client.wait(job.id).state == "succeeded", secured.log("service")
    finally:
        secured.close()

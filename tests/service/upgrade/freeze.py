"""Writes the fixture of the upgrade test: the data folder of a service of this version, killed at work.

Run by hand before the schema version is raised, from the root of the repository:

    python -m tests.service.upgrade.freeze

It writes ``version-N.tar.xz`` beside this file, with the data folder (database, files, checkpoints) and
``expected.json``, what the service answered to each tenant before it was killed.
"""

import hashlib
import io
import json
import tarfile
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_service.rows.database import open_database
from bentray_service.rows.deliveries import WebhookSecrets
from bentray_service.rows.ids import Tenant
from bentray_service.rows.tables import VERSION
from bentray_workers.files.dataset import write_dataset

from ...faults.live_service import LiveService
from ...waiting import wait_until

TENANTS = ("clinic", "lab")
LISTS = ("jobs", "datasets", "volumes", "meshes", "batches")
# A webhook at which nobody listens: its message waits for another attempt when the service is killed.
WEBHOOK, NETWORK = "http://127.0.0.1:9/ended", "127.0.0.0/8"
DONE = {"method": "sart", "nodes": 24, "iterations": 2, "attenuation": {"enabled": False}}
# Killed after its first checkpoints.
LONG = {**DONE, "nodes": 32, "iterations": 60}
TETRAHEDRON = b"""ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 1 2 3
3 0 3 2
"""


def main() -> None:
    """Write the archive."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        service = LiveService(root, TENANTS, workers=1, BENTRAY_WEBHOOK_NETWORKS=NETWORK)
        try:
            _create_secrets(service)
            expected = {tenant: _use(root, service, tenant) for tenant in TENANTS}
            _begin_long_job(service, expected)
        finally:
            service.kill()
        target = Path(__file__).parent / f"version-{VERSION}.tar.xz"
        with tarfile.open(target, "w:xz", preset=9) as archive:
            archive.add(service.data, "data", filter=_without_owner)
            content = json.dumps(expected, indent=1).encode()
            entry = tarfile.TarInfo("expected.json")
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    print(f"{target}: {target.stat().st_size} bytes")  # noqa: T201 - a program


def _create_secrets(service: LiveService) -> None:
    with closing(open_database(f"sqlite:///{service.data / 'bentray.sqlite'}")) as database:
        for tenant in TENANTS:
            WebhookSecrets(database).create(Tenant(tenant))


def _use(root: Path, service: LiveService, tenant: str) -> dict[str, Any]:
    """What a tenant does with everything that is stored; returns what it then sees."""
    with _client(service, tenant) as http:
        scan = root / f"{tenant}.h5"
        write_dataset(scan, _scan())
        dataset = _made(http.post("/v1/datasets", content=scan.read_bytes(), headers=_type("x-hdf5")))
        _made(http.patch(f"/v1/datasets/{dataset}", json={"title": f"Scan of {tenant}", "notes": "cold"}))
        job = _made(http.post("/v1/jobs", json={**_request(dataset, DONE), "webhook": WEBHOOK}))
        _wait(http, job)
        wait_until(lambda: _job(http, job)["webhook"]["attempts"])
        _made(http.patch(f"/v1/jobs/{job}", json={"name": "the first"}))
        volume = io.BytesIO()
        np.savez(volume, speed=np.linspace(1400.0, 1600.0, 8**3).reshape(8, 8, 8))
        _made(http.post("/v1/volumes", content=volume.getvalue(), headers=_type("octet-stream")))
        _made(http.post("/v1/meshes", content=TETRAHEDRON, headers=_type("octet-stream")))
        batch = http.post("/v1/batches", json={"datasets": [dataset], "name": "Ward 3", "settings": DONE})
        _made(batch)
        _wait(http, batch.json()["jobs"][0]["id"])
        project = http.post("/v1/projects", json={"name": f"Trial of {tenant}"})
        _made(project)
        member = {"member": "user:alice", "role": "reader"}
        http.put(project.json()["links"]["members"], json=member).raise_for_status()
        projects = [http.get(project.json()["links"]["self"]).json()]
        webhook = _job(http, job)["webhook"]
        return {"dataset": dataset, "done": job, "projects": projects, "webhook": webhook, **_seen(http)}


def _begin_long_job(service: LiveService, expected: dict[str, Any]) -> None:
    """A job that has saved checkpoints, and one that waits; neither is in the lists of ``expected``."""
    with _client(service, "clinic") as http:
        job = _made(http.post("/v1/jobs", json=_request(expected["clinic"]["dataset"], LONG)))
        folder = service.data / "tenants/clinic/work" / job / "checkpoints"
        wait_until(lambda: len(list(folder.glob("*.npz"))) >= 2, 300.0, 0.005)
        expected["clinic"]["interrupted"] = job
    service.kill()
    assert len(list(folder.glob("*.npz"))) >= 1


def _seen(http: httpx.Client) -> dict[str, Any]:
    """The lists of a tenant, and the digest of every file that it can download."""
    seen: dict[str, Any] = {name: http.get(f"/v1/{name}").json()[name] for name in LISTS}
    files = {}
    for volume in seen["volumes"]:
        address = f"/v1/volumes/{volume['id']}/data?format=npy"
        answer = http.get(address)
        answer.raise_for_status()
        files[address] = hashlib.sha256(answer.content).hexdigest()
    return {**seen, "files": files}


def _scan() -> Dataset:
    ring, emitters = Ring(16, 0.08), np.arange(16)
    delta = TravelTimeScan(table6(1500.0), ring, TABLE6_SIDE_M, nodes=48).delta_tof(emitters)
    return Dataset(ring.positions(), emitters, emitters, 1500.0, delta_tof_s=delta)


def _request(dataset: str, settings: dict[str, Any]) -> dict[str, Any]:
    return {"kind": "reconstruction", "dataset": dataset, "settings": settings}


def _type(name: str) -> dict[str, str]:
    return {"Content-Type": f"application/{name}"}


def _made(answer: httpx.Response) -> str:
    assert answer.is_success, answer.text
    return str(answer.json()["id"])


def _wait(http: httpx.Client, job: str) -> None:
    state = wait_until(
        lambda: (found := _job(http, job)["state"]) not in ("queued", "running") and found, 600
    )
    assert state == "succeeded"


def _job(http: httpx.Client, job: str) -> dict[str, Any]:
    return dict(http.get(f"/v1/jobs/{job}").json())


def _client(service: LiveService, tenant: str) -> httpx.Client:
    key = {"Authorization": f"Bearer {service.keys[tenant]}"}
    return httpx.Client(base_url=service.url, headers=key, timeout=120.0)


def _without_owner(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = ""
    return entry


if __name__ == "__main__":
    main()

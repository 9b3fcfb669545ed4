"""What earlier versions left is read: their databases, files, checkpoints and backups."""

import hashlib
import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest

from bentray_kernels.tomography import reconstruct
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_service.backup.archive import Description, write_sums
from bentray_service.backup.restore import restore
from bentray_service.files.disk import sha256_of
from bentray_service.rows.database import open_database
from bentray_service.rows.deliveries import Deliveries
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys
from bentray_service.rows.projects import Projects
from bentray_service.rows.tables import VERSION
from bentray_service.settings import ServiceSettings
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset import read_dataset
from bentray_workers.files.reconstruction import read_reconstruction

from .freeze import LISTS, LONG

# The oldest that is taken over; ``test_migration`` has the rows of the later ones.
pytestmark = pytest.mark.parametrize("left", ["version-12"], indirect=True)


def keys_for(folder, tenants):
    """New keys of the tenants; the archive has only digests of the old ones."""
    headers = {}
    with closing(open_database(f"sqlite:///{folder / 'bentray.sqlite'}")) as database:
        for tenant in tenants:
            token = ApiKey.new()
            Keys(database).add(token, Tenant(tenant), "test", ("read", "write"))
            headers[tenant] = {"Authorization": f"Bearer {token.shown()}"}
    return headers


def known_before(now, before):
    """A record without the fields that the earlier version did not have, those of its parts too."""
    if not isinstance(before, dict) or not isinstance(now, dict):
        return now
    return {key: known_before(now[key], before[key]) for key in before}


def check(http, headers, expected):
    """Every record that was there is there, and has at least the same values; so is every file."""
    # Versions before 11 had no batches.
    for name in (name for name in LISTS if name in expected):
        found = {one["id"]: one for one in http.get(f"/v1/{name}", headers=headers).json()[name]}
        for before in expected[name]:
            now = found[before["id"]]
            assert known_before(now, before) == before
    assert expected["files"]
    for address, digest in expected["files"].items():
        assert hashlib.sha256(http.get(address, headers=headers).content).hexdigest() == digest


def check_rows(folder, tenant, expected):
    """Projects with their members, which other keys do not see, and messages to webhooks."""
    with closing(open_database(f"sqlite:///{folder / 'bentray.sqlite'}")) as database:
        projects, deliveries = Projects(database), Deliveries(database)
        found = projects.all(Tenant(tenant), None)
        before = expected.get("projects", [])
        assert [(row.id, row.name) for row in found] == [(one["id"], one["name"]) for one in before]
        for row, one in zip(found, before, strict=True):
            members = [(member.member, member.role) for member in projects.members(row)]
            assert members == [(member["member"], member["role"]) for member in one["members"]]
        sent = deliveries.of_job(Tenant(tenant), expected["done"])
        assert (sent is None) == ("webhook" not in expected)
        if sent is not None:
            assert (sent.id, sent.url) == (expected["webhook"]["message"], expected["webhook"]["url"])
            assert len(sent.log) >= len(expected["webhook"]["attempts"]) >= 1


@pytest.fixture
def workers(tmp_path):
    """A cluster that runs tasks."""
    with open_cluster(workers=1, local_directory=tmp_path / "scratch", processes=False) as cluster:
        yield cluster


def test_a_service_killed_at_work_continues(left, start, workers, until, tmp_path):
    job = left["clinic"]["interrupted"]
    work = tmp_path / "data/tenants/clinic/work" / job / "checkpoints"
    assert list(work.glob("*.npz"))
    headers = keys_for(tmp_path / "data", ("clinic", "lab"))
    http = start("data", cluster=workers)
    for tenant, mine in headers.items():
        check(http, mine, left[tenant])
        check_rows(tmp_path / "data", tenant, left[tenant])
        assert {one["id"] for one in http.get("/v1/datasets", headers=mine).json()["datasets"]} == {
            left[tenant]["dataset"]
        }
    http.headers = headers["clinic"]
    ended = until(http, job)
    assert ended["state"] == "succeeded", ended["error"]
    assert not work.exists()
    files = tmp_path / "data/tenants/clinic"
    found = read_reconstruction(files / "volumes" / f"{ended['volume']}.h5")
    scan = read_dataset(files / "datasets" / f"{left['clinic']['dataset']}.h5")
    # Of one version, whatever the checkpoints were of.
    assert np.array_equal(found.speed, reconstruct(scan, from_stored(LONG)).speed)


def test_a_backup_of_an_earlier_version_is_restored(left, start, work, tmp_path):
    data, backup = tmp_path / "data", tmp_path / "backup"
    shutil.copytree(data / "tenants", backup / "tenants")
    for folder in backup.glob("tenants/*/work"):
        shutil.rmtree(folder)
    # As `bentray backup` copies it: one file, with the rows that were still in the log of SQLite.
    with closing(sqlite3.connect(data / "bentray.sqlite")) as source:
        version = source.execute("SELECT version FROM about").fetchone()[0]
        with closing(sqlite3.connect(backup / "database.sqlite")) as target:
            source.backup(target)
    assert version <= VERSION
    files = [path for path in backup.rglob("*") if path.is_file()]
    sums = write_sums(backup, {str(path.relative_to(backup)): sha256_of(path) for path in files})
    Description("0.1.0", version, 1.0, "0" * 32, len(files) - 1, 1, (), sums).write(backup)
    restore(backup, ServiceSettings(data_dir=tmp_path / "restored"))
    headers = keys_for(tmp_path / "restored", ("clinic", "lab"))
    http = start("restored")
    for tenant, mine in headers.items():
        check(http, mine, left[tenant])
        check_rows(tmp_path / "restored", tenant, left[tenant])

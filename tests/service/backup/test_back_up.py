"""Backups of a running service: restored elsewhere they serve the same bits; interrupted ones continue."""

import hashlib
import json
import signal
import subprocess
import sys
from contextlib import closing

import pytest
from sqlalchemy import select, text

from bentray_kernels.errors import InvalidInput
from bentray_service.backup import archive
from bentray_service.backup import back_up as writing
from bentray_service.backup import restore as restoring
from bentray_service.backup.back_up import back_up
from bentray_service.backup.restore import restore
from bentray_service.files.checked_store import CheckedStore
from bentray_service.files.data_folder import Files
from bentray_service.files.store import Store
from bentray_service.rows.checksums import Checksums
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import Tenant, new_id
from bentray_service.rows.keys import ApiKey, Keys
from bentray_service.rows.stored_tables import Datasets
from bentray_service.rows.tables import DatasetRow
from bentray_service.settings import ServiceSettings

from ..conftest import STREAM, created
from ..rows.conftest import SUMMARY
from ..tus_records import TUS

TENANTS = ("clinic", "lab")
LISTS = ("jobs", "datasets", "volumes", "meshes")
TETRAHEDRON = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


class Member:
    """A service as one tenant sees it."""

    def __init__(self, http, key):
        self.app = http.app
        self._http, self._headers = http, {"Authorization": f"Bearer {key}"}

    def __getattr__(self, name):
        def call(*words, headers=None, **rest):
            return getattr(self._http, name)(*words, headers={**self._headers, **(headers or {})}, **rest)

        return call


@pytest.fixture
def databases(postgresql_server):
    """Addresses of new databases of PostgreSQL."""
    made = []

    def new():
        made.append(postgresql_server.new_database())
        return made[-1]

    yield new
    for address in made:
        postgresql_server.drop(address)


@pytest.fixture
def used(start, work, uploaded, submitted, until):
    """Start a service that two tenants have used; returns it as each sees it."""

    def go(folder="data", **settings):
        http = start(folder, **settings)
        members, keys = {}, Keys(http.app.state.stores.database)
        for tenant in TENANTS:
            token = ApiKey.new()
            keys.add(token, Tenant(tenant), "test", ("read", "write"))
            members[tenant] = Member(http, token.shown())
        while http.get("/v1/jobs").status_code != 401:
            pass
        for member in members.values():
            until(member, submitted(member, uploaded(member))["id"], "succeeded")
            created(member.post("/v1/meshes", content=TETRAHEDRON, headers=STREAM))
        return members

    return go


@pytest.fixture
def stored(tmp_path):
    """The settings of a service with two scans of each tenant, which does not run."""
    settings = ServiceSettings(data_dir=tmp_path / "data")
    store_scans(settings)
    return settings


def store_scans(settings):
    root = settings.data_dir
    with closing(open_stored(settings)) as database:
        files = Files(root, CheckedStore(Store(), root, Checksums(database)))
        for tenant in TENANTS:
            for size in (1, 2):
                path = files.of(tenant).dataset(new_id("dataset"))
                path.write_bytes(bytes(size) + path.name.encode())
                files.store.publish(path)
                summary = {**SUMMARY, "counts": {"third": 1.0 / 3.0}}
                Datasets(database).add(Tenant(tenant), path.stem, size=size, sha256="", summary=summary)


def open_stored(settings):
    Files(settings.data_dir).prepare()
    return open_database(settings.database)


def rows(settings):
    """The rows of all scans; floating-point numbers keep every bit."""
    with closing(open_database(settings.database)) as database:
        return [row.values() for row in database.rows(select(DatasetRow))]


def keys_of(members):
    return {name: member._headers["Authorization"].split()[1] for name, member in members.items()}


def settings_of(member):
    return member.app.state.access.settings


def seen(member):
    """Everything that a tenant sees, with the digests of its files."""
    found = {name: member.get(f"/v1/{name}").json()[name] for name in LISTS}
    for volume in found["volumes"]:
        data = member.get(f"/v1/volumes/{volume['id']}/data?format=hdf5")
        assert data.status_code == 200
        found[volume["id"]] = hashlib.sha256(data.content).hexdigest()
    for dataset in found["datasets"]:
        found[dataset["id"]] = member.get(f"/v1/datasets/{dataset['id']}/geometry").json()
    return found


@pytest.mark.parametrize(
    "kinds",
    [
        "sqlite to postgresql",
        pytest.param("postgresql to sqlite", marks=pytest.mark.nightly),
        pytest.param("sqlite to sqlite", marks=pytest.mark.nightly),
    ],
)
def test_restored_elsewhere_it_serves_the_same_bits(
    kinds, used, start, submitted, until, work, databases, tmp_path
):
    before, after = (databases() if kind == "postgresql" else None for kind in kinds.split(" to "))
    members = used(database_url=before)
    expected = {name: seen(member) for name, member in members.items()}
    clinic = members["clinic"]
    work.hold.clear()
    work.begun.clear()
    running, queued = (
        submitted(clinic, expected["clinic"]["datasets"][0]["id"], nodes=nodes)["id"] for nodes in (24, 28)
    )
    assert work.begun.wait(60.0)
    begun = clinic.post(
        "/v1/uploads",
        headers={
            **TUS,
            "Upload-Length": "1000",
            "Upload-Metadata": "type ZGF0YXNldA==,filename c2Nhbi5oNQ==",
        },
    )
    assert begun.status_code == 201, begun.text
    made = back_up(settings_of(clinic), tmp_path / "backup")
    # Scan, volume and mesh of each tenant.
    assert (made.items, made.missing) == (6, ())
    work.hold.set()
    truth = {job: until(clinic, job, "succeeded") for job in (running, queued)}
    sums = subprocess.run(["sha256sum", "--quiet", "-c", "SHA256SUMS"], cwd=tmp_path / "backup", check=False)
    assert sums.returncode == 0

    settings = ServiceSettings(data_dir=tmp_path / "restored", database_url=after)
    assert restore(tmp_path / "backup", settings) == made
    # The jobs go on when the lists have been compared.
    work.hold.clear()
    http = start("restored", database_url=after)
    again = {name: Member(http, key) for name, key in keys_of(members).items()}
    for name, member in again.items():
        assert {**seen(member), "jobs": None} == {**expected[name], "jobs": None}
        known = {job["id"] for job in expected[name]["jobs"]}
        jobs = [job for job in member.get("/v1/jobs").json()["jobs"] if job["id"] in known]
        assert jobs == expected[name]["jobs"]
    work.hold.set()
    other = expected["lab"]["volumes"][0]["id"]
    assert again["clinic"].get(f"/v1/volumes/{other}").status_code == 404
    head = again["clinic"].head(begun.headers["location"], headers=TUS)
    assert head.status_code == 404
    for job, ended in truth.items():
        found = until(again["clinic"], job, "succeeded")
        assert found["history"] == ended["history"]
        address = f"/v1/volumes/{found['volume']}/data?format=npy"
        assert again["clinic"].get(address).content == clinic.get(address).content
    # The numbers of new rows follow those that were copied.
    new = submitted(again["clinic"], expected["clinic"]["datasets"][0]["id"], nodes=20)["id"]
    assert again["clinic"].get("/v1/jobs").json()["jobs"][0]["id"] == new
    audited = [path.read_text() for path in (tmp_path / "restored/audit").iterdir()]
    assert expected["lab"]["datasets"][0]["id"] in "".join(audited)


@pytest.mark.nightly
def test_files_come_from_one_bucket_and_go_to_another(
    used, start, bucket_url, s3_server, monkeypatch, tmp_path
):
    members = used(storage_url=bucket_url)
    expected = {name: seen(member)["volumes"] for name, member in members.items()}
    settings = settings_of(members["lab"])
    for path in settings.data_dir.glob("tenants/*/volumes/*.h5"):
        path.unlink()
    assert back_up(settings, tmp_path / "backup").missing == ()
    other = ServiceSettings(data_dir=tmp_path / "restored", storage_url=s3_server.new_bucket(monkeypatch))
    restore(tmp_path / "backup", other)
    for path in other.data_dir.glob("tenants/*/*/*.h5"):
        path.unlink()
    http = start("restored", storage_url=other.storage_url)
    for name, key in keys_of(members).items():
        assert seen(Member(http, key))["volumes"] == expected[name]
    # Not into a bucket that a service uses.
    third = ServiceSettings(data_dir=tmp_path / "third", storage_url=bucket_url)
    with pytest.raises(InvalidInput, match="used by another database"):
        restore(tmp_path / "backup", third)


# Ends the process at its third copy as `kill -9` would.
KILLED = """
import os, signal, sys
from pathlib import Path
from bentray_service.backup import {module} as module
from bentray_service.settings import ServiceSettings
copies, copy = 0, module.copy_file
def third(*words):
    global copies
    copies += 1
    if copies == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return copy(*words)
module.copy_file = third
settings, folder = ServiceSettings(data_dir=Path(sys.argv[1])), Path(sys.argv[2])
module.{call}
"""


def killed(module, call, *words):
    code = KILLED.format(module=module, call=call)
    done = subprocess.run([sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr


@pytest.mark.nightly
def test_killed_on_both_ways(used, start, monkeypatch, tmp_path):
    members = used()
    expected = {name: seen(member) for name, member in members.items()}
    settings, backup = settings_of(members["lab"]), tmp_path / "backup"
    killed("back_up", "back_up(settings, folder)", settings.data_dir, backup)
    assert not (backup / "backup.json").exists()
    new = ServiceSettings(data_dir=tmp_path / "restored")
    with pytest.raises(InvalidInput, match="unfinished backup"):
        restore(backup, new)
    copied = []

    def counted(source, target, *rest):
        copied.append(target)
        return archive.copy_file(source, target, *rest)

    monkeypatch.setattr(writing, "copy_file", counted)
    made = back_up(settings, backup)
    # Two files were there already, and the audit log has one.
    assert len(copied) == 6 - 2 + 1
    assert not list(backup.rglob("*.partial"))
    assert {path.name for path in backup.iterdir()} == {
        *("backup.json", "SHA256SUMS", "database.sqlite", "tenants", "audit"),
    }

    killed("restore", "restore(folder, settings)", new.data_dir, backup)
    with pytest.raises(InvalidInput, match="restored in part"):
        start("restored")
    with pytest.raises(InvalidInput, match="not empty"):
        back_up(settings, new.data_dir)
    assert restore(backup, new) == made
    http = start("restored")
    for name, key in keys_of(members).items():
        assert seen(Member(http, key)) == expected[name]
    with pytest.raises(InvalidInput, match="not empty"):
        restore(backup, new)


def test_a_disk_that_fills_up_leaves_no_backup(stored, monkeypatch, tmp_path):
    copies = []

    def full(source, target, *rest):
        copies.append(target)
        if len(copies) == 4:
            raise OSError(28, "No space left on device", str(target))
        return archive.copy_file(source, target, *rest)

    monkeypatch.setattr(writing, "copy_file", full)
    with pytest.raises(OSError, match="No space"):
        back_up(stored, tmp_path / "backup")
    assert not (tmp_path / "backup/backup.json").exists()
    assert archive.newest_backup(stored.data_dir) is None
    back_up(stored, tmp_path / "backup")
    assert archive.newest_backup(stored.data_dir) is not None


def test_an_item_deleted_meanwhile_is_not_in_it(used, monkeypatch, tmp_path):
    lab = used()["lab"]
    gone, kept = lab.get("/v1/volumes").json()["volumes"][0], lab.get("/v1/meshes").json()["meshes"][0]
    copy_items, moments = writing._Copier.copy_items, []

    def deleting(self, items, report):
        moments.append(len(items))
        if len(moments) == 1:
            assert lab.delete(f"/v1/volumes/{gone['id']}").status_code == 204
        return copy_items(self, items, report)

    monkeypatch.setattr(writing._Copier, "copy_items", deleting)
    made = back_up(settings_of(lab), tmp_path / "backup")
    assert moments == [6, 5]
    assert (made.items, made.missing) == (5, ())
    names = (tmp_path / "backup/SHA256SUMS").read_text()
    assert kept["id"] in names
    assert gone["id"] not in names
    assert not list((tmp_path / "backup").rglob(f"{gone['id']}*"))


def test_a_damaged_file_is_named_and_the_rest_is_kept(used, start, tmp_path):
    members = used()
    lab = members["lab"]
    volume = lab.get("/v1/volumes").json()["volumes"][0]["id"]
    settings = settings_of(lab)
    path = settings.data_dir / "tenants/lab/volumes" / f"{volume}.h5"
    content = bytearray(path.read_bytes())
    content[100] ^= 1
    path.write_bytes(content)
    made = back_up(settings, tmp_path / "backup")
    assert (made.items, made.missing) == (5, (f"lab/{volume}",))
    assert not list((tmp_path / "backup").rglob(f"{volume}*"))
    restore(tmp_path / "backup", ServiceSettings(data_dir=tmp_path / "restored"))
    again = Member(start("restored"), keys_of(members)["lab"])
    assert again.get(f"/v1/volumes/{volume}/data?format=npy").status_code == 500
    assert again.get(f"/v1/volumes/{volume}").status_code == 200


def test_equal_files_of_an_earlier_backup_are_linked(stored, tmp_path):
    back_up(stored, tmp_path / "first")
    store_scans(stored)
    back_up(stored, tmp_path / "second", tmp_path / "first")
    shared, own = 0, 0
    for path in (tmp_path / "second").rglob("*.h5"):
        before = tmp_path / "first" / path.relative_to(tmp_path / "second")
        assert not before.exists() or before.stat().st_ino == path.stat().st_ino
        shared, own = shared + before.exists(), own + (not before.exists())
    assert (shared, own) == (4, 4)


@pytest.mark.parametrize("what", ["file", "list", "database", "description"])
def test_a_changed_backup_is_refused(what, stored, tmp_path):
    backup, new = tmp_path / "backup", ServiceSettings(data_dir=tmp_path / "restored")
    back_up(stored, backup)
    path = {
        "file": next(backup.rglob("*.h5")),
        "list": backup / "SHA256SUMS",
        "database": backup / "database.sqlite",
        "description": backup / "backup.json",
    }[what]
    content = path.read_bytes()
    path.write_bytes(content[:20] + bytes([content[20] ^ 1]) + content[21:])
    with pytest.raises(InvalidInput, match=path.name):
        restore(backup, new)
    if what in ("file", "database"):
        with pytest.raises(InvalidInput, match="restored in part"):
            Files(new.data_dir).check_restored()
        path.write_bytes(content)
        restore(backup, new)
        assert rows(new) == rows(stored)


def test_a_path_that_leads_out_is_refused(tmp_path):
    for name in ("tenants/../../etc/passwd", "/etc/passwd", "service.lock"):
        digest = archive.write_sums(tmp_path, {name: "0" * 64})
        with pytest.raises(InvalidInput, match="paths below tenants and audit"):
            archive.read_sums(tmp_path, digest)


def test_what_is_no_place_for_a_backup(stored, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other/file").touch()
    back_up(stored, tmp_path / "backup")
    for folder, found in (
        (stored.data_dir / "backup", "inside of the data folder"),
        (tmp_path / "other", "not empty"),
        (tmp_path / "backup", "complete backup"),
    ):
        with pytest.raises(InvalidInput, match=found):
            back_up(stored, folder)
    with archive.unfinished_backup(tmp_path / "busy"), pytest.raises(InvalidInput, match="another process"):
        back_up(stored, tmp_path / "busy")
    with pytest.raises(InvalidInput, match="does not exist"):
        back_up(ServiceSettings(data_dir=tmp_path / "nothing"), tmp_path / "new")
    assert not (tmp_path / "nothing").exists()
    assert not (tmp_path / "new").exists()


def test_a_database_of_another_version_is_not_touched(stored, tmp_path):
    with closing(open_database(stored.database)) as database, database.write() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = 5"))
    with pytest.raises(InvalidInput, match="schema version 5"):
        back_up(stored, tmp_path / "backup")
    assert not (tmp_path / "backup").exists()


def test_a_database_in_use_is_no_place_to_restore(stored, databases, tmp_path):
    address = databases()
    open_database(address).close()
    back_up(stored, tmp_path / "backup")
    with pytest.raises(InvalidInput, match="an empty database"):
        restore(tmp_path / "backup", ServiceSettings(data_dir=tmp_path / "new", database_url=address))


def test_a_restoration_killed_after_the_commit_ends(stored, databases, monkeypatch, tmp_path):
    back_up(stored, tmp_path / "backup")
    new = ServiceSettings(data_dir=tmp_path / "new", database_url=databases())

    def died(path):
        raise KeyboardInterrupt

    monkeypatch.setattr(restoring, "remove_database", died)
    with pytest.raises(KeyboardInterrupt):
        restore(tmp_path / "backup", new)
    monkeypatch.undo()
    restore(tmp_path / "backup", new)
    assert not (new.data_dir / "restoring.json").exists()
    assert not (new.data_dir / "restored.sqlite").exists()
    assert rows(new) == rows(stored)


def test_the_commands(bentray, stored, tmp_path):
    made = bentray("backup", tmp_path / "backup", "--data", stored.data_dir, "--json")
    assert json.loads(made.stdout)["items"] == 4
    again = bentray("backup", tmp_path / "backup", "--data", stored.data_dir, code=2)
    assert "complete backup" in again.stderr
    done = bentray("restore", tmp_path / "backup", "--data", tmp_path / "new")
    assert done.stdout == f"bentray serve --data {tmp_path / 'new'}\n"
    for path in stored.data_dir.glob("tenants/lab/datasets/*"):
        path.unlink()
    missing = bentray("backup", tmp_path / "other", "--data", stored.data_dir, code=1)
    assert "missing: lab/ds-" in missing.stdout
    spoiled = bentray("restore", tmp_path / "other", "--data", tmp_path / "new", code=2)
    assert "not empty" in spoiled.stderr

"""Deletion: files and rows of an object and of its results are removed, and no others."""

import time
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest
from sqlalchemy import func, insert, select, update

from bentray_service.access.audit import Audit
from bentray_service.access.quota import Quota
from bentray_service.errors import InUse, UnknownId
from bentray_service.files.data_folder import Files
from bentray_service.files.deletion import Deletion
from bentray_service.files.orphans import Orphans
from bentray_service.housekeeping import DAY_S, Housekeeper
from bentray_service.ingest.receive import UploadLocks
from bentray_service.rows.ages import StoredItem
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, Tenant, new_id, volume_of
from bentray_service.rows.jobs import Jobs, NewJob
from bentray_service.rows.stored_tables import Datasets, GeometryFields, Meshes, Volumes
from bentray_service.rows.tables import (
    Base,
    DatasetRow,
    FieldRow,
    JobRow,
    MeshRow,
    ResultVolumeRow,
    UploadedVolumeRow,
)
from bentray_service.rows.uploads import Uploads
from bentray_service.settings import ServiceSettings

from ..rows.conftest import SUMMARY, volume_row

OTHER = Tenant("other")

GRID = {"shape": [2, 2, 2], "spacing_m": [1.0] * 3, "origin_m": [0.0] * 3}
SURFACE = {"title": "", "format": "ply", "vertices": 4, "faces": 4, "genus": 0, "holes": 0, "coloured": False}
SENT = {"size": 1, "sha256": "0" * 64}


# Every one of them has a row in storage; test_usage tells what becomes of it.
BESIDE = ("alembic_version", "about", "storage")


class Shelf:
    """A database and a folder, filled as the service fills them."""

    def __init__(self, database, root):
        self.database, self.files = database, Files(root)
        self.files.prepare()
        self.jobs, self.volumes = Jobs(database), Volumes(database)
        self.deletion = Deletion(database, self.files)

    def dataset(self, tenant=LOCAL):
        name = new_id("dataset")
        Datasets(self.database).add(tenant, name, summary=SUMMARY, **SENT)
        self.files.of(tenant).dataset(name).write_bytes(b"x")
        return name

    def ended(self, job, tenant=LOCAL, state="succeeded"):
        with self.database.write() as connection:
            change = update(JobRow).where(JobRow.id == job.id)
            connection.execute(change.values(state=state))
        return job.id

    def reconstruction(self, dataset, tenant=LOCAL):
        """A job that has succeeded, its volume, and the exports of that."""
        job = self.ended(self.jobs.add(tenant, NewJob("reconstruction", {}, dataset)))
        name, files = volume_of(job), self.files.of(tenant)
        with self.database.write() as connection:
            values = {"job_id": job, "created": time.time(), "tenant": tenant}
            connection.execute(insert(ResultVolumeRow).values(**values, **volume_row(job)))
        for path in (files.volume(name), files.export(name, "npy"), files.export(name, "nii")):
            path.write_bytes(b"x")
        return job, name

    def simulation(self, state, days=31.0):
        """A job that reads nothing, and ended so many days ago."""
        job = self.ended(self.jobs.add(LOCAL, NewJob("simulation", {})), state=state)
        if days is not None:
            with self.database.write() as connection:
                mine = update(JobRow).where(JobRow.id == job)
                connection.execute(mine.values(finished=time.time() - days * DAY_S))
        return job

    def turntable(self, volume, tenant=LOCAL):
        job = self.ended(self.jobs.add(tenant, NewJob("refraction", {}, volume_id=volume)))
        self.files.of(tenant).animation(job, "zip").write_bytes(b"x")
        return job

    def upload(self, tenant=LOCAL):
        name = new_id("volume")
        self.volumes.uploaded.add(
            tenant, name, summary={"title": "", **GRID, "value_range": [0.0, 1.0]}, **SENT
        )
        self.files.of(tenant).volume(name).write_bytes(b"x")
        return name

    def mesh(self, content="c" * 64, **more):
        name = new_id("mesh")
        summary = {**SURFACE, "repairs": {}, "content": content, **more}
        Meshes(self.database).add(LOCAL, name, summary=summary, **SENT)
        self.files.of(LOCAL).mesh(name).write_bytes(b"x")
        return name

    def field(self, mesh, field):
        job = self.ended(self.jobs.add(LOCAL, NewJob("geometry-field", {}, mesh_id=mesh, field_id=field)))
        folder = self.files.of(LOCAL).field(field)
        if not folder.exists():
            folder.mkdir()
            (folder / "outer.npy").write_bytes(b"x")
            row = {"mesh_id": mesh, "job_id": job, "created": 1.0, "bytes": 1, "settings": {}, "figures": {}}
            with self.database.write() as connection:
                connection.execute(insert(FieldRow).values(id=field, tenant=LOCAL, **row))
        return job

    def delete(self, what, name, tenant=LOCAL):
        self.deletion.delete(StoredItem(tenant, what, name))

    def left(self):
        """The files of all tenants."""
        return sorted(path.name for path in self.files.root.glob("tenants/**/*") if path.is_file())

    def rows(self):
        with self.database.read() as connection:
            tables = [table for table in Base.metadata.sorted_tables if table.name not in BESIDE]
            counts = {
                table.name: connection.execute(select(func.count()).select_from(table)).scalar_one()
                for table in tables
            }
        return {name: count for name, count in counts.items() if count}


@pytest.fixture
def shelf(tmp_path):
    database = open_database(f"sqlite:///{tmp_path / 'b.sqlite'}")
    yield Shelf(database, tmp_path / "data")
    database.close()


def test_deleting_a_scan_deletes_its_results(shelf):
    dataset = shelf.dataset()
    for _ in range(2):
        _, volume = shelf.reconstruction(dataset)
        shelf.turntable(volume)
    shelf.ended(shelf.jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)), state="failed")
    shelf.delete("dataset", dataset)
    assert (shelf.left(), shelf.rows()) == ([], {})
    with pytest.raises(UnknownId):
        shelf.delete("dataset", dataset)


def test_deletion_affects_nothing_else(shelf):
    kept, other = shelf.dataset(), shelf.dataset(OTHER)
    job, volume = shelf.reconstruction(kept)
    animation = shelf.turntable(volume)
    shelf.upload(OTHER)
    before = shelf.left(), shelf.rows()
    gone = shelf.dataset()
    shelf.reconstruction(gone)
    shelf.delete("dataset", gone)
    assert (shelf.left(), shelf.rows()) == before
    for stored in (kept, volume):
        with pytest.raises(UnknownId):
            shelf.delete({"ds": "dataset", "vol": "volume"}[stored.partition("-")[0]], stored, OTHER)
    assert (shelf.left(), shelf.rows()) == before
    assert {shelf.jobs.get(LOCAL, each).id for each in (job, animation)} == {job, animation}
    assert Datasets(shelf.database).get(OTHER, other).id == other


@pytest.mark.parametrize("state", ["queued", "running", "cancelling"])
def test_inputs_of_a_running_job_are_kept(shelf, state):
    dataset = shelf.dataset()
    _, volume = shelf.reconstruction(dataset)
    busy = shelf.ended(shelf.jobs.add(LOCAL, NewJob("refraction", {}, volume_id=volume)), state=state)
    before = shelf.left(), shelf.rows()
    for what, name in (("dataset", dataset), ("volume", volume)):
        with pytest.raises(InUse, match=busy):
            shelf.delete(what, name)
    assert (shelf.left(), shelf.rows()) == before
    shelf.ended(shelf.jobs.get(LOCAL, busy), state="cancelled")
    shelf.delete("dataset", dataset)
    assert (shelf.left(), shelf.rows()) == ([], {})


def test_deleting_a_job_deletes_its_result_only(shelf):
    dataset = shelf.dataset()
    job, volume = shelf.reconstruction(dataset)
    shelf.turntable(volume)
    shelf.delete("volume", volume)
    assert (shelf.left(), shelf.rows()) == ([f"{dataset}.h5"], {"datasets": 1})
    with pytest.raises(UnknownId):
        shelf.jobs.get(LOCAL, job)


def test_an_uploaded_volume_leaves_its_mesh(shelf):
    volume = shelf.upload()
    shelf.turntable(volume)
    mesh = shelf.mesh(volume_id=volume, iso=0.5)
    shelf.delete("volume", volume)
    assert (shelf.left(), shelf.rows()) == ([f"{mesh}.h5"], {"meshes": 1})
    assert Meshes(shelf.database).get(LOCAL, mesh).volume_id is None


def test_deleting_a_mesh_deletes_unshared_fields(shelf):
    field = "field-" + "0" * 20
    first, second = shelf.mesh(), shelf.mesh()
    shelf.field(first, field)
    heir = shelf.field(second, field)
    shelf.delete("mesh", first)
    row = GeometryFields(shelf.database).get(LOCAL, field)
    assert (row.mesh_id, row.job_id) == (second, heir)
    assert shelf.left() == [f"{second}.h5", "outer.npy"]
    shelf.delete("mesh", second)
    assert (shelf.left(), shelf.rows()) == ([], {})


def test_files_that_are_gone_already_do_not_matter(shelf):
    dataset = shelf.dataset()
    shelf.files.of(LOCAL).dataset(dataset).unlink()
    shelf.delete("dataset", dataset)
    assert shelf.rows() == {}


def test_old_data_go_and_young_data_stay(shelf):
    old, young, needed = shelf.dataset(), shelf.dataset(), shelf.dataset(OTHER)
    shelf.reconstruction(old)
    volume, mesh = shelf.upload(), shelf.mesh()
    shelf.jobs.add(OTHER, NewJob("reconstruction", {}, needed))
    with shelf.database.write() as connection:
        for table in (DatasetRow, UploadedVolumeRow, MeshRow):
            aged = update(table).where(table.id != young)
            connection.execute(aged.values(created=time.time() - 31 * DAY_S))
    clocks = Clocks()
    keeper = housekeeper(shelf, clocks, None)
    for _ in range(3):
        keeper.sweep()
        clocks.pass_by(DAY_S)
    assert shelf.rows()["datasets"] == 3
    keeper = housekeeper(shelf, clocks)
    keeper.sweep()
    assert shelf.rows()["datasets"] == 3, "it is marked first"
    clocks.pass_by(DAY_S)
    keeper.sweep()
    assert shelf.left() == sorted([f"{young}.h5", f"{needed}.h5"])
    left = {"datasets": 2, "jobs": 1, "events": 1, "too_old": 1}
    assert shelf.rows() == left, "the one that is needed"
    for gone in (volume, mesh):
        assert not any(gone in name for name in shelf.left())


def test_old_jobs_without_anything_go_too(shelf):
    """As simulations that were cancelled or failed: no dataset takes them along when it goes."""
    dataset = shelf.dataset()
    made = shelf.simulation("succeeded")
    with shelf.database.write() as connection:
        rows = DatasetRow
        connection.execute(update(rows).where(rows.id == dataset).values(job_id=made))
    shelf.reconstruction(dataset)
    young, at_work = shelf.simulation("failed", days=28), shelf.simulation("running", days=None)
    kept = [row.id for row in shelf.jobs.newest(LOCAL, 9)]
    for state in ("cancelled", "failed"):
        shelf.simulation(state)
    clocks = Clocks()
    keeper = housekeeper(shelf, clocks)
    keeper.sweep()
    assert len(shelf.jobs.newest(LOCAL, 9)) == 6, "they are marked first"
    clocks.pass_by(DAY_S - 3600.0)
    keeper.sweep()
    clocks.pass_by(3600.0)
    keeper.sweep()
    assert [row.id for row in shelf.jobs.newest(LOCAL, 9)] == kept
    assert {young, at_work, made} < set(kept)
    assert shelf.rows()["events"] == len(kept)


def test_wrong_clock_deletes_nothing(shelf, caplog):
    shelf.dataset()
    clocks = Clocks()
    keeper = housekeeper(shelf, clocks)
    keeper.sweep()
    clocks.wall += 31 * DAY_S
    for _ in range(3):
        clocks.pass_by(60.0)
        keeper.sweep()
    assert shelf.rows() == {"datasets": 1, "too_old": 1}
    assert "was changed by +2678400 s" in caplog.text
    clocks.wall -= 31 * DAY_S
    clocks.pass_by(60.0)
    keeper.sweep()
    assert "was changed by -2678400 s" in caplog.text
    assert shelf.rows() == {"datasets": 1}
    for _ in range(3):
        clocks.pass_by(DAY_S)
        keeper.sweep()
    assert shelf.rows() == {"datasets": 1}


def test_a_day_of_starts_and_stops_is_counted_without_the_time_between(shelf):
    shelf.dataset()
    clocks = Clocks()
    clocks.wall += 31 * DAY_S
    for hour in range(24):
        keeper = housekeeper(shelf, clocks)
        keeper.sweep()
        assert shelf.rows()["datasets"] == 1, hour
        clocks.pass_by(3600.0)
        keeper.sweep()
        # Nobody looks for a month.
        clocks.wall += 31 * DAY_S
        clocks.steady = 0.0
    assert "datasets" not in shelf.rows()


def test_an_upload_that_ends_by_a_wrong_clock_stays(shelf):
    clocks = Clocks()
    uploads = Uploads(shelf.database)
    row = uploads.add(LOCAL, "dataset", 9, {}, "", DAY_S, 10**9)
    keeper = housekeeper(shelf, clocks, None)
    keeper.sweep()
    clocks.wall += 31 * DAY_S
    clocks.pass_by(60.0)
    keeper.sweep()
    assert uploads.get(LOCAL, row.id).state == "receiving"
    clocks.pass_by(DAY_S)
    keeper.sweep()
    with pytest.raises(UnknownId):
        uploads.get(LOCAL, row.id)


class Clocks:
    """The time of day and the monotonic clock."""

    def __init__(self):
        self.wall, self.steady = time.time(), 0.0

    def __call__(self):
        return self.wall, self.steady

    def pass_by(self, seconds):
        self.wall += seconds
        self.steady += seconds


def test_the_audit_log_is_kept_as_long_as_it_is_said(shelf):
    clocks, folder = Clocks(), shelf.files.audit
    ages = (0, 2, 6.5, 10, 400)
    days = [datetime.fromtimestamp(clocks.wall - age * DAY_S, UTC).strftime("%Y-%m-%d") for age in ages]
    for day in days:
        (folder / f"{day}.jsonl").write_text("{}\n")
    (folder / "2001-01-01.jsonl.gz").touch()
    keeper = housekeeper(shelf, clocks, audit_keep_days=7.0)

    def left():
        return sorted(path.name.partition(".")[0] for path in folder.glob("*.jsonl"))

    keeper.sweep()
    assert left() == sorted(days)
    # A clock that was wrong deletes nothing.
    clocks.wall += 500 * DAY_S
    keeper.sweep()
    clocks.wall -= 500 * DAY_S
    keeper.sweep()
    clocks.pass_by(DAY_S + 1.0)
    keeper.sweep()
    assert left() == sorted(days[:3])


@pytest.mark.parametrize("bucket", [False, True])
def test_the_store_is_tidied_once_an_hour(shelf, monkeypatch, bucket):
    tidied = []
    direct = SimpleNamespace(tidy=lambda _ids: tidied.append("uploads")) if bucket else None
    store = SimpleNamespace(tidy=lambda _stop: tidied.append("store"), direct_uploads=direct)
    monkeypatch.setattr(shelf.files, "store", store)
    keeper = housekeeper(shelf, Clocks())
    monkeypatch.setattr(keeper._orphans, "sweep", lambda _stop: tidied.append("orphans"))
    keeper._step()
    keeper._step()
    assert tidied == ["store", *["uploads"] * bucket, "orphans"]


def housekeeper(shelf, clocks, keep_days=30.0, audit_keep_days=None):
    root, database = shelf.files.root, shelf.database
    settings = ServiceSettings(data_dir=root, keep_days=keep_days, audit_keep_days=audit_keep_days)
    quota, orphans = Quota(database, 10**9), Orphans(shelf.files, database, is_store=True)
    audit = Audit(shelf.files.audit)
    return Housekeeper(settings, database, shelf.files, quota, UploadLocks(), orphans, audit, clocks)

"""Storage use and reservations on every database: by kind, and within the quota for simultaneous requests."""

import asyncio
import time

import pytest
from sqlalchemy import insert

from bentray_service.access.quota import LEASE_S, Quota
from bentray_service.errors import DatabaseUnavailable, QuotaExceeded, RateLimited
from bentray_service.files.data_folder import Files
from bentray_service.files.deletion import Deletion
from bentray_service.rows import uploads as uploading
from bentray_service.rows import usage
from bentray_service.rows.ages import StoredItem
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, Tenant, new_id, volume_of
from bentray_service.rows.jobs import NewJob, Submission
from bentray_service.rows.stored_tables import Datasets
from bentray_service.rows.tables import ResultVolumeRow, StorageRow
from bentray_service.rows.uploads import Uploads
from bentray_service.rows.usage import Usage, usage_by_kind

from .conftest import SUMMARY, at_once, volume_row

# Fewer than a slow database lets wait.
AT_ONCE = 8


OTHER = Tenant("other")


def allowed(ask):
    """How many of simultaneous calls were allowed."""
    told = at_once(ask, AT_ONCE, QuotaExceeded, RateLimited)
    return sum(not isinstance(one, Exception) for one in told)


def test_of_many_at_once_as_many_are_allowed_as_fit(database, address):
    """Through two services, as far as the database is one that they can share."""
    second = database if address.startswith("sqlite") else open_database(address)
    quotas = Quota(database, 100), Quota(second, 100)
    assert allowed(lambda n: quotas[n % 2].resize(LOCAL, f"ds-{n}", 15)) == 6
    assert quotas[0].of(LOCAL) == quotas[1].of(LOCAL) == Usage(0, 90)
    quotas[0].resize(OTHER, "ds-0", 100)
    if second is not database:
        second.close()


def test_of_many_uploads_begun_at_once_as_many_are_allowed_as_fit(database):
    uploads = Uploads(database)
    assert allowed(lambda n: uploads.add(LOCAL, "dataset", 15, {}, "", 60.0, 100)) == 6
    assert len(uploads.in_state("receiving")) == 6
    assert Quota(database, 100).of(LOCAL) == Usage(0, 90)


def test_simultaneous_uploads_stay_within_the_limit(database, monkeypatch):
    monkeypatch.setattr(uploading, "MAX_INCOMPLETE", 5)
    uploads = Uploads(database)
    assert allowed(lambda n: uploads.add(LOCAL, "dataset", 1, {}, "", 60.0, 100)) == 5
    with pytest.raises(RateLimited, match="5 incomplete uploads; accepted: fewer than 5") as refused:
        uploads.add(LOCAL, "dataset", 1, {}, "", 60.0, 100)
    assert refused.value.wait_s > 0.0
    uploads.add(OTHER, "dataset", 1, {}, "", 60.0, 100)
    uploads.remove(uploads.in_state("receiving")[0].id)
    uploads.add(LOCAL, "dataset", 1, {}, "", 60.0, 100)


def test_of_many_jobs_at_once_as_many_are_allowed_as_fit(database, jobs, dataset, queue):
    Quota(database, 100).stored(LOCAL, dataset, 10)
    new, how = NewJob("reconstruction", {}, dataset, reserved=15), Submission(most_bytes=100)
    assert allowed(lambda n: jobs.add(LOCAL, new, how)) == 6
    assert len(jobs.newest(LOCAL, 99)) == 6
    assert Quota(database, 100).of(LOCAL) == Usage(10, 90)
    jobs.request_cancel(LOCAL, jobs.newest(LOCAL, 1)[0].id)
    assert Quota(database, 100).of(LOCAL) == Usage(10, 75)


def test_quota_error_names_stored_reserved_and_allowed_bytes(database):
    quota = Quota(database, 100)
    quota.stored(LOCAL, "vol-1.nii", 50)
    quota.resize(LOCAL, "ds-1", 30)
    found = "50 bytes stored, 30 reserved, 21 more requested; accepted: at most 100 bytes per tenant"
    with pytest.raises(QuotaExceeded, match=found):
        quota.resize(LOCAL, "ds-2", 21)
    quota.resize(LOCAL, "ds-2", 20)
    # What is there already is no reason to refuse its change.
    quota.resize(LOCAL, "ds-1", 29)
    with pytest.raises(QuotaExceeded):
        quota.resize(LOCAL, "ds-1", 31)
    assert quota.of(LOCAL) == Usage(50, 49)


def test_failed_uploads_release_their_reservation(database):
    quota, dataset = Quota(database, 100), new_id("dataset")

    async def take_in(*, whole):
        async with quota.reserved(LOCAL, dataset, 60):
            quota.resize(LOCAL, dataset, 40)
            if not whole:
                raise ConnectionError
            Datasets(database).add(LOCAL, dataset, size=60, sha256="0" * 64, summary=SUMMARY)

    with pytest.raises(ConnectionError):
        asyncio.run(take_in(whole=False))
    assert quota.of(LOCAL) == Usage(0, 0)
    asyncio.run(take_in(whole=True))
    assert quota.of(LOCAL) == Usage(40, 0)


def test_unavailable_database_keeps_no_reservation(database, monkeypatch):
    quota = Quota(database, 100)

    def away():
        raise DatabaseUnavailable("no answer")

    quota.resize(LOCAL, "ds-1", 60)
    monkeypatch.setattr(database, "write", away)
    quota.release(LOCAL, "ds-1")
    assert quota.of(LOCAL) == Usage(0, 60)
    monkeypatch.undo()
    quota.renew()
    assert quota.of(LOCAL) == Usage(0, 0)


def test_an_upload_has_its_room_until_it_is_forgotten_refused_or_stored(database):
    quota, uploads = Quota(database, 100), Uploads(database)
    forgotten, refused, stored = (uploads.add(LOCAL, "dataset", 20, {}, "", 60.0, 100) for _ in range(3))
    assert quota.of(LOCAL) == Usage(0, 60)
    uploads.remove(forgotten.id)
    uploads.keep(refused.id, 60.0, state="refused", problem={"detail": "no scan"})
    quota.resize(LOCAL, stored.result_id, 70)
    Datasets(database).add(LOCAL, stored.result_id, size=20, sha256="0" * 64, summary=SUMMARY)
    uploads.keep(stored.id, 60.0, state="done")
    # Its row goes, and what it has become stays.
    for one in (refused, stored):
        uploads.remove(one.id)
    assert quota.of(LOCAL) == Usage(70, 0)


@pytest.mark.parametrize("end", ["succeed", "fail", "cancelled", "animation"])
def test_a_job_has_its_room_until_its_end(database, jobs, queue, dataset, end):
    quota = Quota(database, 100)
    before = quota.of(LOCAL).stored
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset, reserved=60), Submission(most_bytes=100)).id
    assert queue.claim().id == job
    for size, reserved in ((50, 60), (80, 80)):
        queue.record_size(job, size)
        assert quota.of(LOCAL) == Usage(before, reserved)
    queue.release(job, "the workers were away")
    queue.claim()
    assert quota.of(LOCAL).reserved == 80
    {
        "succeed": lambda: queue.succeed(job, volume_row(job, 9)),
        "animation": lambda: queue.succeed(job, None, size=9),
        "fail": lambda: queue.fail(job, {"detail": "odd"}),
        "cancelled": lambda: queue.mark_cancelled(job),
    }[end]()
    assert quota.of(LOCAL) == Usage(before + (9 if end in ("succeed", "animation") else 0), 0)


def test_deletion_releases_quota_of_derived_objects(database, jobs, queue, tmp_path):
    quota, files, dataset = Quota(database, 1000), Files(tmp_path / "data"), new_id("dataset")
    files.prepare()
    Datasets(database).add(LOCAL, dataset, size=60, sha256="0" * 64, summary=SUMMARY)
    job = jobs.add(LOCAL, NewJob("simulation", {}, dataset, reserved=60), Submission(most_bytes=1000)).id
    queue.claim()
    queue.succeed(job, None, size=9)
    quota.stored(LOCAL, f"{dataset}.nii", 5)
    quota.stored(LOCAL, "vol-of-another", 7)
    assert quota.of(LOCAL) == Usage(60 + 9 + 5 + 7, 0)
    Deletion(database, files).delete(StoredItem(LOCAL, "dataset", dataset))
    assert quota.of(LOCAL) == Usage(7, 0)


def test_reservations_of_a_process_that_died_expire_and_those_of_a_living_one_do_not(database, tmp_path):
    files = Files(tmp_path / "data")
    files.prepare()
    now = time.time()
    dead, living = (Quota(database, 100, clock=lambda: now - LEASE_S - 1.0) for _ in range(2))
    dead.resize(LOCAL, "ds-dead", 60)
    living.resize(LOCAL, "ds-living", 30)
    uploads = Uploads(database)
    uploads.add(LOCAL, "dataset", 5, {}, "", 60.0, 1000)
    # It was slow, but lives.
    living._clock = lambda: now
    living.renew()
    third = Quota(database, 100)
    assert third.of(LOCAL) == Usage(0, 35)
    third.resize(LOCAL, "ds-new", 65)
    # An upload in pieces belongs to no process.
    third.begin(files, alone=True)
    assert third.of(LOCAL) == Usage(0, 5)


def test_at_the_start_the_sizes_are_those_of_the_files(database, dataset, tmp_path):
    """Of a version that did not count: the canonical file is not as large as what was uploaded."""
    quota, files = Quota(database, 1000), Files(tmp_path / "data")
    files.prepare()
    mine, volume, job = files.of(LOCAL), new_id("volume"), new_id("job")
    mine.dataset(dataset).write_bytes(bytes(70))
    mine.export(volume, "nii").write_bytes(bytes(5))
    mine.animation(job, "zip").write_bytes(bytes(3))
    mine.field("field-" + "0" * 20).mkdir()
    (mine.field("field-" + "0" * 20) / "outer.npy").write_bytes(bytes(200))
    for _ in range(2):
        quota.begin(files, alone=True)
        assert quota.of(LOCAL) == Usage(278, 0)


def kinds(database, tenant=LOCAL):
    return {kind: tuple(entry) for kind, entry in usage_by_kind(database, tenant).items()}


def test_every_kind_is_counted_once(database, jobs):
    scan = new_id("dataset")
    job = jobs.add(LOCAL, NewJob("refraction", {})).id
    result = volume_of(job)
    cube = {"axes": "x", "shape": [1], "spacing_m": [1.0], "origin_m": [0.0], "speed_range_mps": [1.0, 1.0]}
    row = {"id": result, "job_id": job, "created": 1.0, "bytes": 20, "water_speed_mps": 1.0, "provenance": {}}
    sizes = {scan: 10, result: 20, f"{result}.nii": 30, new_id("volume"): 40, new_id("mesh"): 50}
    sizes |= {new_id("field"): 60, job: 70}
    with database.write() as connection:
        connection.execute(insert(ResultVolumeRow).values(tenant=LOCAL, **row, **cube))
        for name, size in sizes.items():
            usage.store(connection, LOCAL, name, size)
        usage.store(connection, OTHER, new_id("dataset"), 1000)
        usage.reserve(connection, LOCAL, new_id("upload"), 80, 10**6)
        usage.reserve(connection, LOCAL, new_id("dataset"), 5, 10**6)
    found = kinds(database)
    assert found == {
        "scans": (1, 10, 5),
        "results": (1, 20, 0),
        "volumes": (1, 40, 0),
        "meshes": (1, 50, 0),
        "geometry-fields": (1, 60, 0),
        "exports": (1, 30, 0),
        "jobs": (1, 70, 0),
        "uploads": (0, 0, 80),
    }
    used = Quota(database, 10**6).of(LOCAL)
    assert used.stored == sum(stored for _, stored, _ in found.values())
    assert used.reserved == sum(reserved for *_, reserved in found.values())
    assert kinds(database, OTHER) == {"scans": (1, 1000, 0)}


def test_reservations_of_dead_processes_do_not_count(database):
    with database.write() as connection:
        late = {"lease_owner": "dead", "lease_until": 1.0}
        row = {"tenant": LOCAL, "name": new_id("job"), "bytes": 7, "reserved": True}
        connection.execute(insert(StorageRow).values(**row, **late))
    assert kinds(database) == {}

"""Storage by kind: every item is counted once, under its kind, for its tenant."""

from sqlalchemy import insert

from bentray_service.access.quota import Quota
from bentray_service.rows import usage
from bentray_service.rows.ids import LOCAL, Tenant, new_id, volume_of
from bentray_service.rows.jobs import NewJob
from bentray_service.rows.tables import ResultVolumeRow, StorageRow
from bentray_service.rows.usage import usage_by_kind

OTHER = Tenant("other")


def kinds(database, tenant=LOCAL):
    return {one.kind: (one.items, one.stored, one.reserved) for one in usage_by_kind(database, tenant)}


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

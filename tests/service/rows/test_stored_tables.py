"""Rows of meshes and geometry fields: kept as given, one field per content, closed to invented ids."""

import pytest

from bentray_service.errors import UnknownId
from bentray_service.rows.ids import LOCAL, Tenant, field_of, new_id
from bentray_service.rows.job_queue import Queue
from bentray_service.rows.jobs import Jobs, NewJob
from bentray_service.rows.stored_tables import GeometryFields, Meshes
from bentray_service.rows.tables import FieldRow

MESH = {
    "title": "a ball",
    "format": "ply",
    "vertices": 6,
    "faces": 8,
    "genus": 0,
    "holes": 0,
    "coloured": False,
    "repairs": {"merged": 18},
    "content": "c" * 64,
}


def test_meshes_are_kept_as_given_and_newest_first(database):
    meshes = Meshes(database)
    made = [meshes.add(LOCAL, new_id("mesh"), size=9, sha256="f" * 64, summary=MESH) for _ in range(3)]
    row = made[0]
    assert MESH.items() <= row.values().items()
    assert (row.bytes, row.volume_id, row.iso) == (9, None, None)
    assert meshes.get(LOCAL, row.id).values() == row.values()
    assert [found.id for found in meshes.newest(LOCAL, 2)] == [one.id for one in made[:0:-1]]


@pytest.mark.parametrize(
    ("table", "name", "listed"),
    [(Meshes, "mesh-" + "0" * 20, "meshes"), (GeometryFields, field_of("a" * 64), "geometry-fields")],
)
def test_missing_objects_are_not_found(database, table, name, listed):
    with pytest.raises(UnknownId, match=f"GET /v1/{listed}"):
        table(database).get(LOCAL, name)


def finished(database, mesh, content, size, tenant=LOCAL):
    """A job that succeeds with a field of that content; its id."""
    field = field_of(content)
    jobs, queue = Jobs(database), Queue(database)
    jobs.add(tenant, NewJob("geometry-field", {"samples": 8}, mesh_id=mesh, field_id=field))
    job = queue.claim()
    assert (job.mesh_id, job.field_id) == (mesh, field)
    row = {"id": field, "mesh_id": mesh, "bytes": size, "settings": {"samples": 8}, "figures": {"faces": 1}}
    assert queue.succeed(job.id, row, FieldRow)
    return job.id


def test_the_same_content_is_one_field(database):
    fields, mesh = GeometryFields(database), new_id("mesh")
    first = finished(database, mesh, "a" * 64, 7)
    finished(database, mesh, "a" * 64, 8)
    finished(database, mesh, "b" * 64, 9)
    row = fields.get(LOCAL, field_of("a" * 64))
    assert (row.job_id, row.bytes, row.figures) == (first, 7, {"faces": 1})
    assert [one.id for one in fields.newest(LOCAL, 9)] == [field_of("b" * 64), field_of("a" * 64)]


def test_tenants_have_fields_of_the_same_content_and_do_not_see_each_others(database):
    fields, name, other = GeometryFields(database), field_of("a" * 64), Tenant("other")
    mine = finished(database, new_id("mesh"), "a" * 64, 7)
    with pytest.raises(UnknownId):
        fields.get(other, name)
    theirs = finished(database, new_id("mesh"), "a" * 64, 7, other)
    assert (fields.get(LOCAL, name).job_id, fields.get(other, name).job_id) == (mine, theirs)
    assert len(fields.newest(other, 9)) == 1

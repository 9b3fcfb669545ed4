"""The rows of geometry fields: one per content, whichever jobs requested it."""

import pytest

from bentray_service.errors import UnknownId
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, Tenant, field_of, new_id
from bentray_service.rows.job_queue import Queue
from bentray_service.rows.jobs import Jobs, NewJob
from bentray_service.rows.stored_tables import GeometryFields
from bentray_service.rows.tables import FieldRow


@pytest.fixture
def database(tmp_path):
    opened = open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    yield opened
    opened.close()


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


def test_missing_objects_are_not_found(database):
    with pytest.raises(UnknownId, match="GET /v1/geometry-fields"):
        GeometryFields(database).get(LOCAL, field_of("a" * 64))


def test_tenants_have_fields_of_the_same_content_and_do_not_see_each_others(database):
    fields, name, other = GeometryFields(database), field_of("a" * 64), Tenant("other")
    mine = finished(database, new_id("mesh"), "a" * 64, 7)
    with pytest.raises(UnknownId):
        fields.get(other, name)
    theirs = finished(database, new_id("mesh"), "a" * 64, 7, other)
    assert (fields.get(LOCAL, name).job_id, fields.get(other, name).job_id) == (mine, theirs)
    assert len(fields.newest(other, 9)) == 1

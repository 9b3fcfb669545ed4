"""The rows of geometry fields: one a content, whichever jobs asked for it."""

import pytest

from bentray_service.refusals import UnknownId
from bentray_service.storage.database import open_database
from bentray_service.storage.geometry_fields import GeometryFields
from bentray_service.storage.ids import field_of, new_id
from bentray_service.storage.jobs import Jobs


@pytest.fixture
def database(tmp_path):
    opened = open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    yield opened
    opened.close()


def finished(jobs, mesh, content, size):
    """A job that succeeds with a field of that content; its id."""
    field = field_of(content)
    jobs.add("geometry-field", {"samples": 8}, mesh_id=mesh, field_id=field)
    job = jobs.claim()
    assert (job["mesh_id"], job["field_id"]) == (mesh, field)
    row = {"id": field, "mesh_id": mesh, "bytes": size, "settings": {"samples": 8}, "figures": {"faces": 1}}
    assert jobs.succeed(job["id"], row, "geometry_fields")
    return job["id"]


def test_the_same_content_is_one_field(database):
    jobs, fields, mesh = Jobs(database), GeometryFields(database), new_id("mesh")
    first = finished(jobs, mesh, "a" * 64, 7)
    finished(jobs, mesh, "a" * 64, 8)
    finished(jobs, mesh, "b" * 64, 9)
    row = fields.get(field_of("a" * 64))
    assert (row["job_id"], row["bytes"], row["figures"]) == (first, 7, {"faces": 1})
    assert [one["id"] for one in fields.newest(9)] == [field_of("b" * 64), field_of("a" * 64)]


def test_what_is_not_there(database):
    with pytest.raises(UnknownId, match="GET /v1/geometry-fields"):
        GeometryFields(database).get(field_of("a" * 64))

"""The rows of meshes: kept as given, newest first, closed to invented ids."""

import pytest

from bentray_service.errors import UnknownId
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, new_id
from bentray_service.rows.stored_tables import Meshes

SUMMARY = {
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


@pytest.fixture
def meshes(tmp_path):
    database = open_database(f"sqlite:///{tmp_path / 'a.sqlite'}")
    yield Meshes(database)
    database.close()


def test_a_row_is_kept_as_given(meshes):
    mesh = new_id("mesh")
    row = meshes.add(LOCAL, mesh, size=9, sha256="f" * 64, summary=SUMMARY)
    assert SUMMARY.items() <= row.values().items()
    assert (row.id, row.bytes, row.volume_id, row.iso) == (mesh, 9, None, None)
    assert meshes.get(LOCAL, mesh).values() == row.values()


def test_newest_first(meshes):
    made = [meshes.add(LOCAL, new_id("mesh"), size=1, sha256="f", summary=SUMMARY).id for _ in range(3)]
    assert [row.id for row in meshes.newest(LOCAL, 2)] == made[:0:-1]


def test_missing_objects_are_not_found(meshes):
    with pytest.raises(UnknownId, match="GET /v1/meshes"):
        meshes.get(LOCAL, new_id("mesh"))

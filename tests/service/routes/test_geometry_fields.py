"""/v1/geometry-fields: from an upload to pictures on a real cluster, and every refusal."""

import io
from dataclasses import fields

import pytest
import trimesh
from PIL import Image
from sqlalchemy import insert

from bentray_kernels.meshes.example_surfaces import torus
from bentray_service.rows.ids import LOCAL, field_of, new_id
from bentray_service.rows.jobs import NewJob
from bentray_service.rows.tables import FieldRow
from bentray_workers.files.mesh import StoredMesh, write_mesh
from bentray_workers.rendering import field_view
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.geometry_field import build_field, bytes_of

from ..conftest import STREAM, made_once, refused

SMALL = {"width": 32, "height": 24}
COARSE = {"samples": 6, "inner_samples": 4, "divisions": 4, "image_size": 33}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A field and its figures, to be put into services."""
    folder = tmp_path_factory.mktemp("made")
    write_mesh(folder / "mesh.h5", StoredMesh(torus(16, 10)))
    (folder / "work").mkdir()
    given = FieldSettings(**COARSE), folder / "field", folder / "work"
    figures = build_field(None, folder / "mesh.h5", *given)
    return folder / "field", figures


@pytest.fixture
def here(http, made):
    """The address of a field in a service, as a job leaves it."""
    state, field, mesh = http.app.state, field_of("a" * 64), new_id("mesh")
    source, figures = made
    target = state.stores.files.of(LOCAL).field(field)
    target.mkdir()
    for file in source.iterdir():
        (target / file.name).write_bytes(file.read_bytes())
    job = state.stores.jobs.add(LOCAL, NewJob("reconstruction", {})).id
    row = {"mesh_id": mesh, "bytes": bytes_of(target), "settings": COARSE, "figures": figures}
    with state.stores.database.write() as connection:
        connection.execute(insert(FieldRow).values(id=field, job_id=job, created=1.0, **row))
    return f"/v1/geometry-fields/{field}"


def test_from_an_upload_to_a_picture(on_workers, tmp_path, until):
    ring = torus(16, 10)
    content = trimesh.Trimesh(ring.vertices, ring.faces, process=False).export(file_type="ply")
    with on_workers() as http:
        sent = http.post("/v1/meshes", content=content, headers=STREAM)
        mesh = sent.json()["id"]
        asked = {"kind": "geometry-field", "mesh": mesh, "settings": COARSE}
        job = http.post("/v1/jobs", json=asked).json()
        assert (job["mesh"], job["field"], job["volume"], job["dataset"]) == (mesh, None, None, None)
        assert job["links"]["mesh"] == f"/v1/meshes/{mesh}"
        done = until(http, job["id"])
        assert done["state"] == "succeeded", done["error"]
        assert done["progress"]["done"] == done["progress"]["total"] == 4
        field = http.get(done["links"]["field"]).json()
        assert (field["id"], field["mesh"], field["job"]) == (done["field"], mesh, job["id"])
        assert field["sizes"]["faces"] == 320
        assert field["sizes"]["outer_bytes"] > 216 * 216 * 8
        assert field["errors"]["lookup_median"] < 1e-6
        assert field["seconds"]["outer"] > 0.0
        assert field["settings"] == {**COARSE, "image_threshold": 0.0}
        assert http.get(field["links"]["self"]).json() == field
        assert http.get("/v1/geometry-fields").json() == {"geometry_fields": [field]}
        for name in ("image", "geometry_image", "normal_map"):
            assert field["links"][name] == done["links"][name]
            answer = http.get(field["links"][name], params=SMALL if name == "image" else {})
            assert Image.open(io.BytesIO(answer.content)).size == ((32, 24) if name == "image" else (33, 33))
        # The same again, under another id of the same mesh: the same field, at once.
        twin = http.post("/v1/meshes", content=content, headers=STREAM)
        again = http.post("/v1/jobs", json={**asked, "mesh": twin.json()["id"]}).json()
        done = until(http, again["id"])
        assert (done["state"], done["field"]) == ("succeeded", field["id"])
        assert done["progress"] == {"done": 1, "total": 1, "phase": ""}
        assert http.get("/v1/geometry-fields").json() == {"geometry_fields": [field]}
        assert not list((tmp_path / "data/tenants/local/work").iterdir())


OTHER = {
    "scene": "two-mirrors",
    "mode": "refract",
    "lookup": "nearest",
    "eye": "linear",
    "index": 1.2,
    "share": 0.5,
    "camera": "orthographic",
    "azimuth_deg": 5,
    "elevation_deg": 5,
    "zoom": 2,
    "up": "y",
    "width": 31,
    "height": 31,
    "rays": 2,
    "depth": 2,
    "device": "cpu",
}
# Parameters with an effect in some modes only.
USED_WITH = {"index": {"mode": "refract"}, "share": {"mode": "reflect"}}


def test_every_parameter_changes_the_tag(http, here):
    assert {*OTHER, "positions_m"} == {field.name for field in fields(FieldView)}
    tags = {http.head(f"{here}/image.png", params=SMALL).headers["etag"]}
    for name, value in OTHER.items():
        answer = http.head(f"{here}/image.png", params={**SMALL, **USED_WITH.get(name, {}), name: value})
        assert answer.status_code == 200, answer.text
        tags.add(answer.headers["etag"])
    places = {"scene": "two-mirrors", "positions_m": [0.0, 1.0, 2.0, 3.0]}
    tags.add(http.head(f"{here}/image.png", params={**SMALL, **places}).headers["etag"])
    assert len(tags) == len(OTHER) + 2


def test_published_lookups_are_drawn_or_rejected(http, here, monkeypatch):
    query = {**SMALL, "lookup": "uv-linear", "eye": "uv-nearest"}
    pictures = [http.get(f"{here}/image.png", params=one) for one in (SMALL, query)]
    assert [one.status_code for one in pictures] == [200, 200]
    assert pictures[0].content != pictures[1].content
    monkeypatch.setattr(field_view, "MAX_REFERENCE_SAMPLES", 3)
    answer = http.get(f"{here}/image.png", params=query)
    assert answer.status_code == 422
    assert "samples" in answer.text


@pytest.mark.parametrize("view", ["image.png?width=32&height=24", "geometry-image.png", "normal-map.png"])
def test_a_picture_is_made_once(http, here, cluster, view):
    made_once(http, cluster, f"{here}/{view}")
    assert http.get(f"{here}/{view}").headers["content-type"] == "image/png"
    how = cluster.submitted[-1]
    assert (how["resources"], how["priority"]) == ({"render": 1}, 10)
    assert ("quantity" in how) != view.startswith("image.png")


def test_large_picture_is_drawn_in_tiles(http, here, cluster):
    answer = http.get(f"{here}/image.png", params={"width": 1024, "height": 600, "depth": 0})
    assert Image.open(io.BytesIO(answer.content)).size == (1024, 600)
    assert len(cluster.submitted) == 2 + 1


@pytest.mark.parametrize(
    ("query", "field", "accepted"),
    [
        ("width=4096&height=4096&rays=2", "width, height, rays", "16777216"),
        ("iso=1", "iso", "scene, mode"),
    ],
)
def test_refused_views(http, here, cluster, query, field, accepted):
    refused(http.get(f"{here}/image.png?{query}"), field, accepted)
    assert not cluster.submitted

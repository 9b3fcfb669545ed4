"""/v1/meshes: every format in, every defect refused by name; iso-surfaces of volumes."""

import io
import json

import numpy as np
import pytest
import trimesh
from PIL import Image

from bentray_kernels.meshes.example_surfaces import bumpy_ball, torus
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_kernels.phantoms import ONE_HOLE, sampled
from bentray_service.rows.ids import LOCAL, new_id
from bentray_workers.files.mesh import load_mesh
from bentray_workers.rendering import isosurface_mesh

from ..conftest import STREAM, refused
from ..stored_volumes import store_volume

RING = torus(12, 8)


def off(mesh):
    """As an OFF file, which can hold any nonsense."""
    lines = ["OFF", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    lines += [" ".join(map(str, vertex)) for vertex in mesh.vertices.tolist()]
    lines += [" ".join(map(str, (3, *face))) for face in mesh.faces.tolist()]
    return "\n".join(lines).encode()


def send(http, content, **asked):
    return http.post("/v1/meshes", content=content, headers=STREAM, params=asked)


def mesh_with(vertices=None, faces=None):
    return TriangleMesh(
        RING.vertices if vertices is None else vertices, RING.faces if faces is None else faces
    )


@pytest.mark.parametrize("kind", ["ply", "obj", "off", "stl", "glb"])
def test_every_format(http, kind):
    content = trimesh.Trimesh(RING.vertices, RING.faces, process=False).export(file_type=kind)
    content = content.encode() if isinstance(content, str) else content
    answer = send(http, content, title="a ring")
    made = answer.json()
    assert answer.status_code == 201, made
    assert answer.headers["location"] == made["links"]["self"]
    assert (made["format"], made["title"], made["faces"], made["vertices"]) == (kind, "a ring", 192, 96)
    assert (made["genus"], made["closed"], made["holes"], made["coloured"]) == (1, True, 0, False)
    assert (made["volume"], made["iso"], made["bytes"]) == (None, None, len(content))
    assert http.get(made["links"]["self"]).json() == made
    assert [one["id"] for one in http.get("/v1/meshes").json()["meshes"]] == [made["id"]]
    stored = load_mesh(http.app.state.stores.files.of(LOCAL).mesh(made["id"])).mesh
    assert stored.faces.shape == (192, 3)


def test_a_mesh_is_drawn_without_a_field(http):
    made = send(http, off(RING)).json()
    views = [{"mode": mode, "width": 24, "height": 20} for mode in ("diffuse", "refract")]
    answers = [http.get(made["links"]["image"], params=view) for view in views]
    assert [answer.headers["content-type"] for answer in answers] == ["image/png"] * 2
    assert answers[0].content != answers[1].content
    assert Image.open(io.BytesIO(answers[0].content)).size == (24, 20)
    tags = {http.head(made["links"]["image"], params={**views[0], "up": up}).headers["etag"] for up in "xyz"}
    assert len(tags) == 3
    refused(http.get(made["links"]["image"], params={"lookup": "nearest"}), "lookup")
    refused(http.get(f"/v1/meshes/{new_id('mesh')}/image.png"), "mesh", status=404)


def test_repairs_are_reported(http):
    doubled = RING.vertices[RING.faces].reshape(-1, 3)
    faces = np.arange(3 * 192).reshape(-1, 3)
    faces[7] = faces[7, ::-1]
    made = send(http, off(mesh_with(doubled, faces))).json()
    assert (made["repairs"]["merged_vertices"], made["repairs"]["turned_faces"]) == (480, 1)
    listed = np.vstack((RING.faces, RING.faces[:2, ::-1], [[0, 0, 1]]))
    repairs = send(http, off(mesh_with(faces=listed))).json()["repairs"]
    assert (repairs["repeated_faces"], repairs["flat_faces"], repairs["turned_faces"]) == (2, 1, 0)
    left = RING.corners.mean(axis=1)[:, 0] < 0.3
    half_a_ring = send(http, off(mesh_with(faces=RING.faces[left]))).json()
    assert (half_a_ring["closed"], half_a_ring["holes"], half_a_ring["genus"]) == (False, 2, 0)


BROKEN = {
    "no faces": (mesh_with(faces=RING.faces[:0]), "faces", "none"),
    "NaN": (mesh_with(np.where(RING.vertices > 1.3, np.nan, RING.vertices)), "vertices", "not finite"),
    "three faces on an edge": (
        mesh_with(
            np.vstack((RING.vertices, [[0, 0, 9]])), np.vstack((RING.faces, [[*RING.faces[0, :2], 96]]))
        ),
        "faces",
        "three faces or more",
    ),
    "two pieces": (
        mesh_with(np.vstack((RING.vertices, RING.vertices + 5.0)), np.vstack((RING.faces, RING.faces + 96))),
        "faces",
        "2 pieces",
    ),
    "faces without area": (
        mesh_with(faces=np.repeat(RING.faces[:, :1], 3, axis=1)),
        "faces",
        "without area",
    ),
    "rows that are not there": (mesh_with(faces=RING.faces + 90), "file", ""),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_mesh_is_rejected_by_name(http, name):
    mesh, field, found = BROKEN[name]
    body = refused(send(http, off(mesh)), field)
    assert body["type"] == "/problems/invalid-input"
    assert found in body["found"], body
    assert http.get("/v1/meshes").json() == {"meshes": []}
    assert not list((http.app.state.stores.files.of(LOCAL).root / "incoming").iterdir())


def test_a_surface_with_one_side_is_rejected(http):
    turn = np.arange(12)
    angle = 2 * np.pi * turn / 12
    half = 0.3 * np.array([-1.0, 1.0])[:, None]
    radius = 1.0 + half * np.cos(angle / 2)
    edge = np.stack((radius * np.cos(angle), radius * np.sin(angle), half * np.sin(angle / 2)), axis=-1)
    faces = []
    for k in range(12):
        low, high = (k + 1) % 12, (k + 1) % 12 + 12
        if k == 11:
            low, high = high, low
        faces += [(k, low, k + 12), (low, high, k + 12)]
    body = send(http, off(TriangleMesh(edge.reshape(-1, 3), np.array(faces)))).json()
    assert (body["status"], body["field"], body["accepted"]) == (422, "faces", "one with two sides")


def test_other_refusals(http):
    assert http.post("/v1/meshes", content=b"x", headers={"Content-Type": "text/plain"}).status_code == 415
    refused(http.get("/v1/meshes/" + new_id("mesh")), "mesh", status=404)
    outside = {"buffers": [{"uri": "secret.bin", "byteLength": 4}], "asset": {"version": "2.0"}}
    refused(send(http, json.dumps(outside).encode()), "buffers/uri")


def volume(http, values=None, spacing=(1e-3,) * 3):
    """The address of a stored volume."""
    return f"/v1/volumes/{store_volume(http, sampled(ONE_HOLE, 20) if values is None else values, spacing)}"


def test_the_surface_of_a_volume(http, cluster):
    here = volume(http)
    answer = http.post(f"{here}/mesh", params={"iso": 0.4})
    made = answer.json()
    assert answer.status_code == 201, made
    assert cluster.submitted[-1]["resources"] == {"render": 1}
    assert (made["format"], made["title"], made["iso"], made["closed"]) == ("isosurface", "a ball", 0.4, True)
    assert made["links"]["volume"] == here
    assert made["volume"] == here.rpartition("/")[2]
    assert made["faces"] > 500
    coarse = http.post(f"{here}/mesh", params={"iso": 0.4, "step": 2}).json()
    assert coarse["faces"] < 0.5 * made["faces"]
    assert {one["id"] for one in http.get("/v1/meshes").json()["meshes"]} == {made["id"], coarse["id"]}
    assert not list((http.app.state.stores.files.of(LOCAL).root / "incoming").iterdir())


@pytest.mark.parametrize(
    ("query", "field"), [("iso=7", "iso"), ("iso=nan", "iso"), ("step=0", "step"), ("step=99", "step")]
)
def test_refused_surfaces(http, query, field):
    refused(http.post(f"{volume(http)}/mesh?{query}"), field)


def test_a_surface_that_is_too_large(http, monkeypatch):
    monkeypatch.setattr(isosurface_mesh, "MAX_CROSSINGS", 50)
    refused(http.post(f"{volume(http)}/mesh"), "iso", "a larger step")
    assert not list((http.app.state.stores.files.of(LOCAL).root / "incoming").iterdir())


def test_a_coloured_mesh(http):
    ball = bumpy_ball(200)
    shown = trimesh.Trimesh(ball.vertices, ball.faces, vertex_colors=[[200, 30, 30]] * len(ball.vertices))
    made = send(http, io.BytesIO(shown.export(file_type="ply")).getvalue()).json()
    assert made["coloured"]

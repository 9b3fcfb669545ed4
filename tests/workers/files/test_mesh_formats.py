"""Foreign meshes: every format is read; hostile or damaged files are rejected."""

import base64
import io
import json

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.example_surfaces import torus
from bentray_workers.files import mesh_formats
from bentray_workers.files.mesh_formats import read_mesh

from ...effort import effort

FORMATS = ("ply", "obj", "off", "stl", "stl_ascii", "glb", "gltf")


def exported(file_type, colours=None):
    """A torus of 80 faces as a file."""
    surface = torus(8, 5)
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, vertex_colors=colours, process=False)
    if file_type == "gltf":
        return gltf(mesh)
    data = mesh.export(file_type=file_type)
    return data.encode() if isinstance(data, str) else data


def gltf(mesh):
    """Write one file: the buffers of trimesh's several files in it."""
    files = mesh.export(file_type="gltf")
    scene = json.loads(files["model.gltf"])
    for buffer in scene["buffers"]:
        content = base64.b64encode(files[buffer["uri"]]).decode()
        buffer["uri"] = "data:application/octet-stream;base64," + content
    return json.dumps(scene).encode()


@pytest.mark.parametrize("file_type", FORMATS)
def test_every_format(file_type):
    mesh = read_mesh(exported(file_type))
    assert mesh.format == file_type.split("_")[0]
    assert (mesh.surface.genus, mesh.surface.holes, mesh.surface.turned) == (1, 0, 0)
    assert mesh.surface.merged == (200 if "stl" in file_type else 0)
    surface = torus(8, 5)
    corners = mesh.surface.mesh.corners

    def told_apart(faces):
        return np.array(sorted(np.round(np.sort(faces.reshape(-1, 9), axis=1), 3).tolist()))

    np.testing.assert_allclose(told_apart(corners), told_apart(surface.corners), atol=2e-3)
    assert mesh.colours is None


@pytest.mark.parametrize("file_type", ["ply", "obj", "glb", "gltf"])
def test_colours_stay_with_their_vertices(file_type):
    surface = torus(8, 5)
    shades = np.random.default_rng(0).integers(0, 256, (40, 4)).astype(np.uint8)
    mesh = read_mesh(exported(file_type, shades))
    order = [
        np.linalg.norm(surface.vertices - place, axis=1).argmin() for place in mesh.surface.mesh.vertices
    ]
    np.testing.assert_allclose(mesh.colours, shades[order, :3] / 255.0, atol=0.003)


def test_polygons_become_triangles():
    cube = "OFF\n8 6 0\n" + "\n".join(f"{a} {b} {c}" for a in (0, 1) for b in (0, 1) for c in (0, 1))
    cube += "\n4 0 1 3 2\n4 4 6 7 5\n4 0 4 5 1\n4 2 3 7 6\n4 0 2 6 4\n4 1 5 7 3\n"
    mesh = read_mesh(cube.encode()).surface
    assert (len(mesh.mesh.faces), mesh.holes, mesh.genus) == (12, 0, 0)


def test_a_binary_stl_may_begin_like_a_text():
    data = b"solid facet".ljust(80) + exported("stl")[80:]
    assert read_mesh(data).format == "stl"


@pytest.mark.parametrize("file_type", ["ply", "glb", "obj", "off", "stl", "stl_ascii", "gltf"])
@pytest.mark.parametrize("part", [0.3, 0.9])
def test_files_cut_short_are_rejected(file_type, part):
    data = exported(file_type)
    with pytest.raises(InvalidInput):
        read_mesh(data[: int(part * len(data))])


NUMPY = ("array", "reshape", "broadcast", "literal", "axis", "index", "list", "dimension")


@pytest.mark.parametrize("file_type", FORMATS)
def test_truncated_files_get_our_error_message(file_type):
    data = exported(file_type)
    for part in np.linspace(0.01, 0.99, 23):
        try:
            read_mesh(data[: int(part * len(data))])
        except InvalidInput as error:
            words = f"{error.value} {error.accepted}"
            assert not [word for word in NUMPY if word in words.split("begins with")[0]], words


@pytest.mark.parametrize("file_type", ["ply", "off", "obj", "gltf", "stl_ascii"])
def test_a_byte_order_mark_is_passed_over(file_type):
    assert len(read_mesh(b"\xef\xbb\xbf" + exported(file_type)).surface.mesh.faces) == 80


def test_a_long_comment_may_come_before_an_obj():
    assert read_mesh(b"# by hand\n" * 10_000 + exported("obj")).format == "obj"


def test_corners_of_an_obj_may_count_back_from_their_face():
    corners = torus(8, 5).corners
    text = "".join(
        "".join(f"v {x} {y} {z}\n" for x, y, z in face) + "f -3//-1 -2//-1 -1//-1\n" for face in corners
    )
    mesh = read_mesh(text.encode()).surface
    assert (len(mesh.mesh.faces), mesh.genus, mesh.merged) == (80, 1, 200)


def test_an_stl_may_be_written_in_capitals():
    assert len(read_mesh(exported("stl_ascii").upper()).surface.mesh.faces) == 80


@given(
    st.sampled_from(FORMATS),
    st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=4),
)
@settings(max_examples=effort(20, 150), deadline=None)
def test_flipped_bytes_give_a_refusal_or_a_sound_mesh(file_type, flips):
    content = bytearray(exported(file_type))
    for place, value in flips:
        content[int(place * len(content))] = value
    try:
        mesh = read_mesh(bytes(content))
    except InvalidInput:
        return
    assert np.isfinite(mesh.surface.mesh.vertices).all()
    assert mesh.surface.mesh.faces.max() < len(mesh.surface.mesh.vertices)


def lone(place, accepted="three"):
    """An OBJ of one triangle, one of its corners as told."""
    return f"v 0 0 0\nv 1 0 0\nv {place}\nf 1 2 {accepted}\n".encode()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x00\x01\x02 something else", "a file of another kind .it begins with"),
        (lone("0 1 0", "9"), "file: found OBJ data that are truncated, damaged"),
        (lone("0 1 0", "0"), "faces: found 'f 1 2 0' in line 4; accepted: vertices from 1, or from -1 to -3"),
        (lone("0 1 0", "-4"), "faces: found 'f 1 2 -4' in line 4"),
        (lone("2 0 0", "3"), "1 without area"),
        (b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "vertices: found 'v 0 0' in line 1"),
        (b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "an STL of words without its end"),
        (exported("stl")[:-1], r"or a binary STL of \d+ bytes, where its header means \d+"),
    ],
)
def test_rejects_invalid_meshes(data, words):
    with pytest.raises(InvalidInput, match=words):
        read_mesh(data)


PLANE = b"OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"


@pytest.mark.parametrize(
    ("line", "instead"),
    [
        (b"OFF\n", b"OFF "),
        (b"\n", b"\r\n"),
        (b"4 2 0", b"4 2 # edges are not counted"),
        (b"4 2 0", b"4 2 0 # as counted"),
        (b"3 0 1 2\n", b"# the first face\n\n3 0 1 2 # a face\n"),
        (b"3 0 1 2", b"3 0 1 2 255 0 0"),
    ],
)
def test_an_off_may_be_laid_out_freely(line, instead):
    assert len(read_mesh(PLANE.replace(line, instead)).surface.mesh.faces) == 2


@given(st.integers(3, len(PLANE) - 2))
def test_every_truncation_of_an_off_is_detected(length):
    # Only the last digit of the last corner can go without a trace, and that leaves no corner here.
    with pytest.raises(InvalidInput):
        read_mesh(PLANE[:length])


@pytest.mark.parametrize(
    ("line", "instead", "words"),
    [
        (b"4 2 0", b"-4 2 0", "file: found an OFF file that ends too soon"),
        (b"4 2 0", b"many", "file: found OFF data that are truncated, damaged"),
        (b"4 2 0", b"5 2 0", "ends too soon: 6 lines of the 5 vertices and 2 faces"),
        (b"4 2 0", b"4000000000 4000000000 0", "ends too soon"),
        (b"4 2 0", b"9" * 5000 + b" 1 0", "file: found"),
        (b"1 1 0", b"1 x 0", "file: found"),
        (b"1 1 0", b"1 1", "file: found"),
        (b"3 0 2 3", b"3 0 2 4", "file: found"),
        (b"3 0 2 3", b"3 0 2 -1", "file: found"),
        (b"3 0 2 3", b"3 0 2", "faces: found '3 0 2' as face 1; accepted: the number of corners"),
        (b"3 0 2 3", b"2 0 2", "faces: found"),
        (b"3 0 2 3", b"9" * 5000 + b" 0 1 2", "file: found"),
    ],
)
def test_rejects_invalid_off(line, instead, words):
    with pytest.raises(InvalidInput, match=words):
        read_mesh(PLANE.replace(line, instead))


def scene(buffers, **more):
    return json.dumps({"asset": {"version": "2.0"}, "buffers": buffers, "meshes": [], **more}).encode()


def test_images_of_gltf_are_not_looked_at(monkeypatch):
    surface = torus(8, 5)
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    whole = json.loads(gltf(mesh))
    whole["images"] = [{"uri": "http://127.0.0.1/picture.png"}]
    whole["textures"] = [{"source": 0}]
    whole["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    for part in whole["meshes"]:
        part["primitives"][0]["material"] = 0
    assert read_mesh(json.dumps(whole).encode()).surface.genus == 1


def test_obj_opens_no_material_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret.mtl").write_text("newmtl a\nmap_Kd picture.png\n")
    opened = []
    monkeypatch.setattr("builtins.open", lambda name, *words, **more: opened.append(str(name)))
    data = b"mtllib secret.mtl\nusemtl a\n" + exported("obj")
    assert read_mesh(data).surface.genus == 1
    # A cluster in this process measures its memory meanwhile.
    assert [name for name in opened if not name.startswith("/proc/")] == []


def test_limits(monkeypatch):
    data = exported("ply")
    monkeypatch.setattr(mesh_formats, "MAX_FACES", 79)
    with pytest.raises(InvalidInput, match="faces: found 80; accepted: at most 79"):
        read_mesh(data)
    monkeypatch.setattr(mesh_formats, "LARGEST_BYTES", len(data) - 1)
    with pytest.raises(InvalidInput, match=f"file: found {len(data)} bytes"):
        read_mesh(data)


def test_the_parts_of_a_scene_become_one_mesh():
    surface = torus(8, 5)
    parts = trimesh.Scene()
    halves = surface.corners.mean(axis=1)[:, 0] > 0.0
    for half in (halves, ~halves):
        parts.add_geometry(trimesh.Trimesh(surface.vertices, surface.faces[half], process=False))
    buffer = io.BytesIO(parts.export(file_type="glb"))
    mesh = read_mesh(buffer.getvalue()).surface
    assert (len(mesh.mesh.faces), mesh.genus, mesh.holes) == (80, 1, 0)

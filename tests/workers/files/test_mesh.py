"""Mesh files: exact round trip, names by content, rejected files."""

import h5py
import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_workers.files.mesh import StoredMesh, load_mesh, summary_of, write_mesh

RING = torus(8, 5)
COLOURS = np.linspace(0.0, 1.0, 120).reshape(40, 3)


@pytest.mark.parametrize("colours", [None, COLOURS])
def test_read_back_exactly(tmp_path, colours):
    write_mesh(tmp_path / "m.h5", StoredMesh(RING, colours))
    stored = load_mesh(tmp_path / "m.h5")
    np.testing.assert_array_equal(stored.mesh.vertices, RING.vertices)
    np.testing.assert_array_equal(stored.mesh.faces, RING.faces)
    assert (stored.colours is None) == (colours is None)
    assert stored.content() == StoredMesh(RING, colours).content()


def test_every_part_is_in_the_content():
    moved = TriangleMesh(RING.vertices + 1e-9, RING.faces)
    turned = TriangleMesh(RING.vertices, np.roll(RING.faces, 1, axis=0))
    all_of_them = [StoredMesh(RING), StoredMesh(moved), StoredMesh(turned), StoredMesh(RING, COLOURS)]
    assert len({one.content() for one in all_of_them}) == 4
    assert {len(one.content()) for one in all_of_them} == {64}


def test_summary_lists_repairs():
    faces = RING.faces.copy()
    faces[3] = faces[3, ::-1]
    surface = sound(np.concatenate((RING.vertices, [[9.0, 9.0, 9.0]])), faces)
    summary = summary_of(StoredMesh(surface.mesh), surface, "ply", pieces=3)
    assert (summary["format"], summary["vertices"], summary["faces"]) == ("ply", 40, 80)
    assert (summary["genus"], summary["holes"], summary["coloured"]) == (1, 0, False)
    assert summary["repairs"] == {
        "merged_vertices": 0,
        "unused_vertices": 1,
        "flat_faces": 0,
        "repeated_faces": 0,
        "turned_faces": 1,
        "parted_vertices": 0,
        "dropped_pieces": 2,
    }


@pytest.mark.parametrize(
    ("spoil", "field"),
    [
        (lambda file: file.attrs.update(format="other"), "@format"),
        (lambda file: file.attrs.update(format_version="9"), "@format_version"),
        (lambda file: file.__delitem__("faces"), "faces"),
        (lambda file: file.__delitem__("vertices"), "vertices"),
    ],
)
def test_another_file_is_rejected(tmp_path, spoil, field):
    write_mesh(tmp_path / "m.h5", StoredMesh(RING))
    with h5py.File(tmp_path / "m.h5", "a") as file:
        spoil(file)
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        load_mesh(tmp_path / "m.h5")

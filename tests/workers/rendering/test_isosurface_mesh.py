"""Iso-surfaces as mesh files: the largest piece, bounded in size, rejected input."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.mesh import load_mesh
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.rendering import isosurface_mesh
from bentray_workers.rendering.isosurface_mesh import mesh_volume


def balls(tmp_path, *middles, nodes=24):
    """A volume with a ball of radius 5 nodes about each middle; 1 in its middle, 0 on its surface."""
    points = np.stack(np.meshgrid(*[np.arange(nodes)] * 3, indexing="ij"), axis=-1)
    away = np.min([np.linalg.norm(points - middle, axis=-1) for middle in middles], axis=0)
    write_volume(tmp_path / "v.h5", Volume.from_values(1.0 - away / 5.0, (1e-3, 1e-3, 2e-3)))
    return tmp_path / "v.h5"


def test_a_ball_in_metres(tmp_path):
    result = mesh_volume(balls(tmp_path, (11, 11, 11)), 0.0, 1, tmp_path / "m.h5")
    mesh = load_mesh(tmp_path / "m.h5").mesh
    assert (result["format"], result["genus"], result["holes"], result["iso"]) == ("isosurface", 0, 0, 0.0)
    assert result["faces"] == len(mesh.faces) > 200
    size = np.ptp(mesh.vertices, axis=0)
    np.testing.assert_allclose(size, (0.010, 0.010, 0.020), rtol=0.03)


def test_the_largest_piece_is_taken(tmp_path):
    path = balls(tmp_path, (8, 8, 8), (19, 19, 19))
    mesh = mesh_volume(path, 0.2, 1, tmp_path / "m.h5")
    assert mesh["repairs"]["dropped_pieces"] == 1
    assert mesh["genus"] == 0


def test_coarser_steps_have_fewer_faces(tmp_path):
    path = balls(tmp_path, (11, 11, 11))
    fine, coarse = (mesh_volume(path, 0.0, step, tmp_path / "m.h5")["faces"] for step in (1, 2))
    assert 2.5 < fine / coarse < 6.0


def test_without_an_iso_value_the_middle_of_the_range(tmp_path):
    path = balls(tmp_path, (11, 11, 11))
    mesh = mesh_volume(path, None, 1, tmp_path / "m.h5")
    assert mesh["content"] == mesh_volume(path, mesh["iso"], 1, tmp_path / "m.h5")["content"]


@pytest.mark.parametrize(
    ("iso", "step", "field"), [(7.0, 1, "iso"), (0.0, 0, "step"), (0.0, 33, "step"), (0.0, 24, "step")]
)
def test_rejects_invalid_input(tmp_path, iso, step, field):
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        mesh_volume(balls(tmp_path, (11, 11, 11)), iso, step, tmp_path / "m.h5")
    assert not (tmp_path / "m.h5").exists()


def test_a_large_surface_and_a_large_volume_are_rejected(tmp_path, monkeypatch):
    path = balls(tmp_path, (11, 11, 11))
    monkeypatch.setattr(isosurface_mesh, "MAX_CROSSINGS", 100)
    with pytest.raises(InvalidInput, match="a larger step"):
        mesh_volume(path, 0.0, 1, tmp_path / "m.h5")
    monkeypatch.setattr(isosurface_mesh, "MAX_NODES", 24**3 - 1)
    with pytest.raises(InvalidInput, match="nodes"):
        mesh_volume(path, 0.0, 1, tmp_path / "m.h5")

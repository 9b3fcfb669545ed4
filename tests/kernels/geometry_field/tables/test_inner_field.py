"""The inner field: its points, every entry of a small one, and its batches."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables.cube import samples
from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from bentray_kernels.meshes.surface import surface_of

from ...meshes.test_intersector import first_faces
from ..shapes import ball, dented, inner_of, octahedron, over_the_poles, turned


def test_entries_are_what_rays_from_the_points_meet():
    surface = surface_of(over_the_poles(turned(dented(3))))
    points, _ = spread_points(surface, 4)
    field = inner_of(surface, 4, 4)
    corners = surface.triangles[points, :9].astype(float).reshape(-1, 3, 3)
    positions = samples(4)
    for row, start in enumerate(corners.mean(axis=1)):
        starts = np.tile(start, (len(positions), 1))
        own = np.full(len(positions), points[row], dtype=np.int32)
        faces, distances, _, _ = first_faces(surface, starts, positions - start, own)
        faces[distances > 1.0] = -1
        # The points' last bits depend on the order of sums.
        assert (field.faces[row] != faces).mean() < 0.02


def test_a_ball_meets_itself_inside_and_not_outside():
    surface = surface_of(over_the_poles(turned(octahedron(3))))
    points, _ = spread_points(surface, 6)
    field = inner_of(surface, 5, 6)
    corners = surface.triangles[points, :9].astype(float).reshape(-1, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ahead = samples(5)[None, :, :] - corners.mean(axis=1)[:, None, :]
    inward = (ahead * normal[:, None, :]).sum(axis=2) / np.linalg.norm(normal, axis=1)[:, None]
    assert (field.faces[inward < -0.02] >= 0).all()
    assert (field.faces[inward > 0.0] == -1).all()


def test_points_are_close_to_the_faces_they_stand_for_and_on_their_side():
    surface = surface_of(over_the_poles(dented(4)))
    points, starts = spread_points(surface, 8)
    corners = surface.triangles[:, :9].astype(float).reshape(-1, 3, 3)
    middles = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    chosen = points[starts]
    assert np.abs(middles - middles[chosen]).max() <= 1.0 / 8.0 + 1e-9
    assert ((normal * normal[chosen]).sum(axis=1) > 0.0).mean() > 0.99
    np.testing.assert_array_equal(starts[points], np.arange(len(points)))


def test_batches_make_the_same_table():
    surface = ball(2)
    points, starts = spread_points(surface, 3)
    whole = inner_of(surface, 3, 3)
    batches = [build_inner_rows(surface, 3, part) for part in np.array_split(points, 4)]
    field = inner_field(3, starts, batches)
    np.testing.assert_array_equal(field.faces, whole.faces)
    with pytest.raises(InvalidInput, match="batches"):
        inner_field(3, starts, batches[:-1])


@pytest.mark.parametrize("divisions", [0, 257])
def test_other_divisions_are_rejected(divisions):
    with pytest.raises(InvalidInput, match="divisions"):
        spread_points(ball(1), divisions)

"""The published lookups of (u, v), on a ball whose (u, v) are known."""

import numpy as np
import pytest
from benchmarks.geometry_field._reference_lookup import linear_uv, nearest_uv

from bentray_kernels.geometry_field.tables.cube import samples
from bentray_kernels.geometry_field.tables.reference_field import uv_table
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of

from ..kernels.geometry_field.shapes import field_of, octahedron, over_the_poles, turned
from ..kernels.geometry_field.tables.test_accurate_lookup import rays_through_the_cube
from ..kernels.meshes.test_intersector import first_faces

N = 12


def flat_table(levels: int = 4):
    """A ball whose u and v are x and y: without any seam."""
    mesh = turned(octahedron(levels))
    surface = surface_of(Chart(mesh, mesh.corners[..., :2]))
    return surface, uv_table(surface, field_of(surface, N))


def looked_up(table, origins, directions, how):
    uv = np.empty((len(origins), 2), dtype=np.float32)
    how(N, table, np.float32(origins).T.copy(), np.float32(directions).T.copy(), uv)
    return uv


def test_the_table_holds_where_its_own_rays_end():
    surface, table = flat_table(2)
    points = samples(N)
    i, j = np.nonzero(np.isfinite(table[..., 0]))
    faces, distances, _, _ = first_faces(surface, points[i], points[j] - points[i])
    assert (faces >= 0).mean() > 0.999
    met = faces >= 0
    ends = points[i[met]] + distances[met, None] * (points[j[met]] - points[i[met]])
    np.testing.assert_allclose(table[i[met], j[met]], ends[:, :2], atol=1e-5)


@pytest.mark.nightly
def test_the_samples_own_rays_are_looked_up_exactly():
    _, table = flat_table(3)
    points = samples(N)
    i, j = np.nonzero(np.isfinite(table[..., 0]))
    for how in (nearest_uv, linear_uv):
        uv = looked_up(table, points[i], points[j] - points[i], how)
        np.testing.assert_allclose(uv, table[i, j], atol=2e-5)


def test_linear_errs_less_than_nearest_where_there_is_no_seam():
    surface, table = flat_table()
    origins, directions = rays_through_the_cube(20000, 6)
    faces, distances, _, _ = first_faces(surface, origins, directions)
    ends = (origins + np.where(faces >= 0, distances, np.nan)[:, None] * directions)[:, :2]
    errors = [
        np.linalg.norm(looked_up(table, origins, directions, how) - ends, axis=1)
        for how in (nearest_uv, linear_uv)
    ]
    assert np.nanmedian(errors[1]) < 0.3 * np.nanmedian(errors[0])
    wrong = [np.mean(np.isnan(error) != (faces < 0)) for error in errors]
    assert wrong[0] == wrong[1] < 0.05


def test_linear_averages_across_a_seam_as_published():
    surface = surface_of(over_the_poles(turned(octahedron(4))))
    table = uv_table(surface, field_of(surface, N))
    origins, directions = rays_through_the_cube(20000, 7)
    nearest, linear = (looked_up(table, origins, directions, how) for how in (nearest_uv, linear_uv))
    # A value that neither neighbour has: halfway round the ball.
    apart = np.abs(nearest[:, 0] - linear[:, 0])
    assert np.nanmean(apart > 0.2) > 0.01


def test_rays_that_miss_the_cube_have_no_uv():
    _, table = flat_table(1)
    for how in (nearest_uv, linear_uv):
        uv = looked_up(table, np.array([[2.0, 2.0, 2.0]]), np.array([[1.0, 0.0, 0.0]]), how)
        assert np.isnan(uv).all()

"""Lookups that we do not use: planes of entries, places between entries, and the published (u, v)."""

import numpy as np
import pytest
from benchmarks.geometry_field._plane_lookup import find_by_plane, plane_table
from benchmarks.geometry_field._reference_lookup import find_linear, linear_uv, nearest_uv

from bentray_kernels.geometry_field.tables.agreement import agreement
from bentray_kernels.geometry_field.tables.cube import samples
from bentray_kernels.geometry_field.tables.reference_field import uv_table
from bentray_kernels.meshes.mesh import Chart, TriangleMesh
from bentray_kernels.meshes.surface import surface_of

from ..kernels.geometry_field.shapes import (
    ball,
    dented,
    field_of,
    octahedron,
    over_the_poles,
    random_triangles,
    turned,
)
from ..kernels.geometry_field.tables.test_accurate_lookup import rays_through_the_cube
from ..kernels.meshes.test_intersector import first_faces

N = 12
ASIDE = np.array([[2.0, 2.0, 2.0]]), np.array([[1.0, 0.0, 0.0]])


def columns(origins, directions):
    return np.float32(origins).T.copy(), np.float32(directions).T.copy()


def by_plane(surface, field, origins, directions):
    distances = np.empty(len(origins), dtype=np.float32)
    find_by_plane(plane_table(surface, field), *columns(origins, directions), distances)
    return distances


def linear(surface, field, origins, directions):
    faces, distances = np.empty(len(origins), dtype=np.int32), np.empty(len(origins), dtype=np.float32)
    find_linear(surface, field, agreement(field), *columns(origins, directions), faces, distances)
    np.testing.assert_array_equal(faces >= 0, np.isfinite(distances))
    return distances


def against_exact(how, surface, n, origins, directions):
    """Errors of the places on rays that are met, edges of the cube, and the part that is met in error."""
    _, exact, _, _ = first_faces(surface, origins, directions)
    distances = how(surface, field_of(surface, n), origins, directions)
    both = np.isfinite(exact) & np.isfinite(distances)
    assert both.sum() > 1000
    errors = np.abs(distances[both] - exact[both]) * np.linalg.norm(directions[both], axis=1)
    return errors, np.mean(np.isfinite(exact) != np.isfinite(distances))


def test_the_samples_own_rays_end_where_the_planes_of_their_entries_do():
    # Triangles in all directions: every octant of the packed normals.
    n, surface = 6, surface_of(random_triangles(1, 40))
    field = field_of(surface, n)
    points = samples(n)
    i, j = np.nonzero(field.faces >= 0)
    distances = by_plane(surface, field, points[i], points[j] - points[i])
    # Packing turns planes by up to 1 in 20,000; that counts where a ray nearly runs along one.
    assert np.quantile(np.abs(distances - field.fractions[i, j]), 0.99) < 1e-4


def test_planes_of_a_flat_mesh_are_exact_everywhere():
    corners = np.array([[0.0, 0.0, 0.3], [1.0, 0.0, 0.45], [1.0, 1.0, 0.65], [0.0, 1.0, 0.5]])
    mesh = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    surface = surface_of(Chart(mesh, np.zeros((2, 3, 2))))
    errors, _ = against_exact(by_plane, surface, 5, *rays_through_the_cube(5000, 12))
    assert np.quantile(errors, 0.95) < 2e-4


def test_a_ball_is_found_by_planes_close_to_where_it_is():
    errors, wrong = against_exact(by_plane, ball(5), 16, *rays_through_the_cube(20000, 1))
    assert np.median(errors) < 1e-3
    assert wrong < 0.03


def test_rays_end_by_planes_within_the_cube():
    surface = surface_of(over_the_poles(dented(4)))
    distances = by_plane(surface, field_of(surface, 8), *rays_through_the_cube(20000, 13))
    met = np.isfinite(distances)
    assert met.any()
    assert ((distances[met] > -1e-4) & (distances[met] < 1.0 + 1e-4)).all()


def test_linear_places_err_less_than_a_tenth_of_a_sample():
    surface = surface_of(over_the_poles(turned(octahedron(4))))
    errors, wrong = against_exact(linear, surface, N, *rays_through_the_cube(20000, 8))
    assert np.median(errors) < 0.1 / N
    assert wrong < 0.05


def test_no_linear_place_lies_between_two_sheets():
    # Above the dent rays end at its rim or on its floor; an average would hang in between.
    surface = surface_of(over_the_poles(dented(5)))
    errors, _ = against_exact(linear, surface, N, *rays_through_the_cube(20000, 9))
    assert np.quantile(errors, 0.95) < 3.0 / N


def flat_table(levels: int = 4):
    """A ball whose u and v are x and y: without any seam."""
    mesh = turned(octahedron(levels))
    surface = surface_of(Chart(mesh, mesh.corners[..., :2]))
    return surface, uv_table(surface, field_of(surface, N))


def looked_up(table, origins, directions, how):
    uv = np.empty((len(origins), 2), dtype=np.float32)
    how(N, table, *columns(origins, directions), uv)
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
    nearest, averaged = (looked_up(table, origins, directions, how) for how in (nearest_uv, linear_uv))
    # A value that neither neighbour has: halfway round the ball.
    apart = np.abs(nearest[:, 0] - averaged[:, 0])
    assert np.nanmean(apart > 0.2) > 0.01


def test_rays_that_miss_the_cube_meet_nothing():
    surface, table = flat_table(1)
    for how in (by_plane, linear):
        assert how(surface, field_of(surface, 4), *ASIDE) == np.inf
    for how in (nearest_uv, linear_uv):
        assert np.isnan(looked_up(table, *ASIDE, how)).all()

"""The cut with the nearest entry's plane."""

import numpy as np
from benchmarks.geometry_field._plane_lookup import find_by_plane, plane_table

from bentray_kernels.geometry_field.tables.cube import samples
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of

from ..kernels.geometry_field.shapes import ball, dented, field_of, over_the_poles, random_triangles
from ..kernels.geometry_field.tables.test_accurate_lookup import rays_through_the_cube
from ..kernels.meshes.test_intersector import first_faces


def found(table, origins, directions):
    distances = np.empty(len(origins), dtype=np.float32)
    find_by_plane(table, np.float32(origins).T.copy(), np.float32(directions).T.copy(), distances)
    return distances


def test_the_samples_own_rays_end_where_their_entries_do():
    # Triangles in all directions: every octant of the packed normals.
    n, surface = 6, surface_of(random_triangles(1, 40))
    field = field_of(surface, n)
    points = samples(n)
    i, j = np.nonzero(field.faces >= 0)
    distances = found(plane_table(surface, field), points[i], points[j] - points[i])
    # Packing turns planes by up to 1 in 20,000; that counts where a ray nearly runs along one.
    assert np.quantile(np.abs(distances - field.fractions[i, j]), 0.99) < 1e-4


def test_planes_of_a_flat_mesh_are_exact_everywhere():
    corners = np.array([[0.0, 0.0, 0.3], [1.0, 0.0, 0.45], [1.0, 1.0, 0.65], [0.0, 1.0, 0.5]])
    from bentray_kernels.meshes.mesh import TriangleMesh

    mesh = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    surface = surface_of(Chart(mesh, np.zeros((2, 3, 2))))
    origins, directions = rays_through_the_cube(5000, 12)
    _, exact, _, _ = first_faces(surface, origins, directions)
    distances = found(plane_table(surface, field_of(surface, 5)), origins, directions)
    both = np.isfinite(exact) & np.isfinite(distances)
    assert both.sum() > 1000
    errors = np.abs(distances[both] - exact[both]) * np.linalg.norm(directions[both], axis=1)
    assert np.quantile(errors, 0.95) < 2e-4


def test_a_ball_is_found_close_to_where_it_is():
    surface = ball(5)
    origins, directions = rays_through_the_cube(20000, 1)
    _, exact, _, _ = first_faces(surface, origins, directions)
    distances = found(plane_table(surface, field_of(surface, 16)), origins, directions)
    both = np.isfinite(exact) & np.isfinite(distances)
    errors = np.abs(distances[both] - exact[both]) * np.linalg.norm(directions[both], axis=1)
    assert np.median(errors) < 1e-3
    assert np.mean(np.isfinite(exact) != np.isfinite(distances)) < 0.03


def test_rays_end_within_the_cube():
    surface = surface_of(over_the_poles(dented(4)))
    origins, directions = rays_through_the_cube(20000, 13)
    distances = found(plane_table(surface, field_of(surface, 8)), origins, directions)
    met = np.isfinite(distances)
    assert met.any()
    assert ((distances[met] > -1e-4) & (distances[met] < 1.0 + 1e-4)).all()


def test_rays_that_miss_the_cube_have_no_hit():
    surface = ball(2)
    table = plane_table(surface, field_of(surface, 4))
    assert found(table, np.array([[2.0, 2.0, 2.0]]), np.array([[1.0, 0.0, 0.0]]))[0] == np.inf

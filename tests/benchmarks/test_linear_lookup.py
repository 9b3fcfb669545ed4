"""Linear interpolation of places on rays, and where it is not done."""

import numpy as np
from benchmarks.geometry_field._linear_lookup import find_linear

from bentray_kernels.geometry_field.tables.agreement import agreement
from bentray_kernels.meshes.surface import surface_of

from ..kernels.geometry_field.shapes import dented, field_of, octahedron, over_the_poles, turned
from ..kernels.geometry_field.tables.test_accurate_lookup import rays_through_the_cube
from ..kernels.meshes.test_intersector import first_faces

N = 12


def found(surface, field, origins, directions):
    faces, distances = np.empty(len(origins), dtype=np.int32), np.empty(len(origins), dtype=np.float32)
    o, d = np.float32(origins).T.copy(), np.float32(directions).T.copy()
    find_linear(surface, field, agreement(field), o, d, faces, distances)
    return faces, distances


def test_places_err_less_than_a_tenth_of_a_sample():
    surface = surface_of(over_the_poles(turned(octahedron(4))))
    field = field_of(surface, N)
    origins, directions = rays_through_the_cube(20000, 8)
    expected, at, _, _ = first_faces(surface, origins, directions)
    faces, distances = found(surface, field, origins, directions)
    both = (faces >= 0) & (expected >= 0)
    errors = np.abs(distances[both] - at[both]) * np.linalg.norm(directions[both], axis=1)
    assert np.median(errors) < 0.1 / N
    assert np.mean((faces >= 0) != (expected >= 0)) < 0.05


def test_no_place_lies_between_two_sheets():
    # Above the dent rays end at its rim or on its floor; an average would hang in between.
    surface = surface_of(over_the_poles(dented(5)))
    field = field_of(surface, N)
    origins, directions = rays_through_the_cube(20000, 9)
    _, at, _, _ = first_faces(surface, origins, directions)
    faces, distances = found(surface, field, origins, directions)
    both = (faces >= 0) & np.isfinite(at)
    errors = np.abs(distances[both] - at[both]) * np.linalg.norm(directions[both], axis=1)
    assert np.quantile(errors, 0.95) < 3.0 / N


def test_rays_that_miss_have_no_face():
    surface = surface_of(over_the_poles(octahedron(1)))
    faces, distances = found(
        surface, field_of(surface, 4), np.array([[2.0, 2.0, 2.0]]), np.array([[1.0, 0, 0]])
    )
    assert faces[0] == -1
    assert np.isinf(distances[0])

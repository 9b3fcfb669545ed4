"""Distances from points to triangles and between surfaces, against searches and where they are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere
from bentray_kernels.meshes.geometric_error import geometric_error, spread
from bentray_kernels.meshes.surface_distance import SurfaceGrid

from ...effort import effort
from .examples import flat_patch, mesh, tetrahedron, without


def by_sampling(surface, points, parts=60):
    """The least distance to fine samples of each triangle: never below the true one."""
    a, b = np.meshgrid(np.arange(parts + 1), np.arange(parts + 1))
    weights = np.stack((a, b, parts - a - b), axis=-1)[a + b <= parts] / parts
    samples = (
        (weights[np.newaxis, ..., np.newaxis] * surface.corners[:, np.newaxis]).sum(axis=2).reshape(-1, 3)
    )
    return np.array([np.linalg.norm(samples - point, axis=1).min() for point in points])


@given(st.integers(0, 10_000))
@settings(deadline=None, max_examples=effort(20, 30))
def test_random_triangles(seed):
    random = np.random.default_rng(seed)
    number = random.integers(1, 8)
    surface = mesh(random.normal(size=(3 * number, 3)), np.arange(3 * number).reshape(-1, 3))
    points = 2.0 * random.normal(size=(6, 3))
    distances, sampled = SurfaceGrid(surface).distance(points), by_sampling(surface, points)
    assert (distances <= sampled + 1e-12).all()
    # Samples lie within a step of the nearest point.
    longest = np.linalg.norm(surface.corners - np.roll(surface.corners, 1, axis=1), axis=-1).max()
    assert (distances >= sampled - longest / 60).all()


def test_places_that_are_known():
    grid = SurfaceGrid(tetrahedron())
    points = [
        (0.2, 0.2, -3.0),
        (-1.0, -1.0, -1.0),
        (0.5, -2.0, 0.0),
        (1.0, 1.0, 1.0),
        (0.1, 0.2, 0.0),
        (9.0, 0.0, 0.0),
    ]
    exact = [3.0, np.sqrt(3.0), 2.0, 2.0 / np.sqrt(3.0), 0.0, 8.0]
    assert grid.distance(np.array(points)) == pytest.approx(exact, abs=1e-12)


def test_a_ball():
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (100, 3))
    expected = np.abs(np.linalg.norm(points, axis=1) - 1.0)
    np.testing.assert_allclose(SurfaceGrid(sphere(80, 160)).distance(points), expected, atol=1e-3)


def test_vertices_lie_on_their_mesh_and_flat_faces_do_no_harm():
    ball = bumpy_ball(2000)
    assert SurfaceGrid(ball).distance(ball.vertices).max() < 1e-12
    point = mesh([(1.0, 1.0, 1.0)] * 3, [(0, 1, 2)])
    assert SurfaceGrid(point).distance(np.array([(1.0, 1.0, 3.0)])) == pytest.approx([2.0])


def test_a_surface_is_no_distance_from_itself():
    ball = sphere(12, 12)
    error = geometric_error(ball, ball, 2000)
    assert max(error.rms, error.greatest) < 1e-12


def test_balls_in_each_other():
    first, other = sphere(100, 200), sphere(100, 200)
    error = geometric_error(first, mesh(other.vertices * 1.1, other.faces), 5000)
    assert error.rms == pytest.approx(0.1, rel=0.01)
    assert error.greatest == pytest.approx(0.1, rel=0.02)


def test_what_is_missing_counts_from_the_whole_surface():
    """From the part to the whole there is no distance, from the whole to the part there is."""
    whole = flat_patch(11, 11)
    part = without(whole, np.flatnonzero(whole.corners.mean(axis=1)[:, 0] > 5.0))
    for pair in ((whole, part), (part, whole)):
        error = geometric_error(*pair, 2000)
        # Half the points, and these evenly from 0 to 5 away.
        assert error.rms == pytest.approx(np.sqrt(0.5 * 25.0 / 3.0), rel=0.02)
        assert error.greatest == pytest.approx(5.0, rel=0.02)


def test_points_are_spread_by_area():
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 5), (3, 0, 5), (0, 3, 5)]
    points = spread(mesh(corners, [(0, 1, 2), (3, 4, 5)]), 10_000)
    assert (points[:, 2] > 2.5).mean() == pytest.approx(0.9, abs=1e-3)
    low = points[points[:, 2] < 2.5]
    np.testing.assert_allclose(low.mean(axis=0), (1 / 3, 1 / 3, 0.0), atol=0.03)

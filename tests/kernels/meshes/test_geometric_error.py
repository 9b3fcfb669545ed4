"""Errors between surfaces whose distance is known."""

import numpy as np
import pytest

from bentray_kernels.meshes.example_surfaces import sphere
from bentray_kernels.meshes.geometric_error import geometric_error, spread

from .examples import flat_patch, mesh, without


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

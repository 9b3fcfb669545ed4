"""Rows of rays and wave fronts: exact times and arcs, and what B-splines and first order do to them."""

import numpy as np
from benchmarks.published._published_rays import distance_from_arcs, exact_times, times_of


def test_times_are_those_of_the_medium():
    times = exact_times(61)
    np.testing.assert_allclose(times, times_of("accurate", 61), atol=3e-4)
    # |∇T| = 1/(1 + 4x), away from the source.
    slopes = np.hypot(*np.gradient(times, 1.0 / 60))[10:-5, 20:-5]
    speed = 1.0 + 4.0 * np.linspace(0.0, 1.0, 61)[10:-5, None]
    np.testing.assert_allclose(slopes * speed, 1.0, atol=5e-3)


def test_b_splines_follow_the_arcs_of_exact_times_better():
    times = exact_times(65)
    assert distance_from_arcs(times, "bspline") < 0.3 * distance_from_arcs(times, "differences") < 0.005

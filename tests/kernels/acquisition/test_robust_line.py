"""A line through points with outliers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition.robust_line import robust_line


@given(
    slope=st.floats(-10.0, 10.0),
    intercept=st.floats(-10.0, 10.0),
    points=st.integers(2, 60),
    seed=st.integers(0, 2**16),
)
def test_outliers_do_not_move_it(slope, intercept, points, seed):
    """A fifth of 240 points at few or many places, equal but for rounding, lies anywhere above the line."""
    random = np.random.default_rng(seed)
    x = random.permutation(np.resize(np.linspace(1.0, 2.0, points), 240)) * (1.0 + 1e-16)
    x += random.choice([0.0, 2.2e-16], x.size)
    y = slope * x + intercept + 0.01 * random.standard_normal(x.size)
    y[random.permutation(x.size)[:48]] += random.uniform(1.0, 50.0, 48)
    result = robust_line(x, y)
    assert result == pytest.approx((slope, intercept), abs=0.05)


def test_points_at_one_place_have_no_slope():
    assert robust_line(np.full(20, 3.0), np.arange(20.0)) == (0.0, 9.5)


@pytest.mark.parametrize("points", [2, 3, 5, 7])
def test_too_few_points_for_outliers_still_have_their_line(points):
    x = np.arange(float(points))
    assert robust_line(x, 2.0 * x + 1.0) == pytest.approx((2.0, 1.0))

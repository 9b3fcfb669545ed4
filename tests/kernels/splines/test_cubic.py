"""The cubic spline equals scipy's, and its slopes those of the parabola it reproduces."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import spline_filter

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.splines.cubic import coefficients, jet_2d, jet_3d, refined

from ...effort import effort


@kernel
def jet(spline, point):
    if spline.ndim == 2:
        value = jet_2d(spline, point[0], point[1])
        return (*value, 0.0, 0.0, 0.0, 0.0)
    return jet_3d(spline, point[0], point[1], point[2])


@given(
    shape=st.one_of(
        st.tuples(st.integers(1, 40), st.integers(1, 9)),
        st.tuples(st.integers(1, 9), st.integers(1, 9), st.integers(1, 40)),
    ),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=effort(20, 60), deadline=None)
def test_coefficients_equal_scipys(shape, seed):
    values = np.random.default_rng(seed).uniform(-1.0, 1.0, shape)
    inside = (slice(1, -2),) * len(shape)
    assert np.allclose(coefficients(values)[inside], spline_filter(values, 3, mode="mirror"), atol=1e-12)


@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans())
@settings(max_examples=effort(20, 60), deadline=None)
def test_jets_are_value_slope_and_second_derivative(seed, flat):
    """Second differences of a cubic spline over a small step, anywhere in the grid, its rim included."""
    rng = np.random.default_rng(seed)
    shape = (6, 9) if flat else (4, 6, 5)
    n = len(shape)
    spline = coefficients(rng.uniform(0.0, 1.0, shape))
    low = rng.integers(0, np.array(shape) - 1)
    point = low + rng.uniform(0.05, 0.95, n)

    def value(p):
        return jet(spline, p)[0]

    values = jet(spline, point)
    step, unit = 1e-4, np.eye(n)
    slopes = [(value(point + step * e) - value(point - step * e)) / (2.0 * step) for e in unit]
    seconds = [
        (
            value(point + step * (unit[a] + unit[b]))
            - value(point + step * (unit[a] - unit[b]))
            - value(point - step * (unit[a] - unit[b]))
            + value(point - step * (unit[a] + unit[b]))
        )
        / (4.0 * step * step)
        for a in range(n)
        for b in range(a, n)
    ]
    assert np.allclose(values[1 : 1 + n], slopes, atol=1e-6)
    assert np.allclose(values[1 + n : 1 + n + len(seconds)], seconds, atol=1e-5)


def test_spline_passes_through_the_nodes():
    values = np.random.default_rng(3).uniform(0.0, 1.0, (7, 5))
    spline = coefficients(values)
    for node in np.ndindex(values.shape):
        assert abs(jet(spline, np.array(node, float))[0] - values[node]) < 1e-13


@given(
    shape=st.tuples(st.integers(1, 9), st.integers(1, 9)), times=st.integers(1, 4), seed=st.integers(0, 99)
)
@settings(max_examples=effort(20, 40), deadline=None)
def test_a_refined_grid_is_the_spline_read_between_the_nodes(shape, times, seed):
    values = np.random.default_rng(seed).uniform(0.0, 1.0, shape)
    fine = refined(values, times)
    assert fine.shape == tuple(times * (n - 1) + 1 for n in shape)
    assert np.allclose(fine[::times, ::times], values, atol=1e-12)
    spline = coefficients(values)
    for node in np.ndindex(fine.shape):
        assert abs(fine[node] - jet(spline, np.array(node) / times)[0]) < 1e-12

"""The prefilter: scipy's coefficients, the minimum of a smoothing spline, smoothing that fits the noise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.ndimage import spline_filter1d

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.rendering_limits import MAX_SMOOTHING
from bentray_kernels.splines import Spline, noise_of, smoothing_for_noise
from bentray_kernels.splines.prefilter import prefilter, sampled_bspline, symbols
from bentray_kernels.splines.smoothing import ROUNDING, response

from ...effort import effort

SHAPES = st.one_of(
    st.tuples(st.integers(1, 70)),
    st.tuples(st.integers(1, 40), st.integers(1, 9)),
    st.tuples(st.integers(1, 7), st.integers(1, 35), st.integers(1, 40)),
)
SEEDS = st.integers(0, 2**32 - 1)
SMOOTHINGS = st.floats(-4.0, 3.0).map(lambda log: 10.0**log)


def basis(order, derivative=0):
    """A B-spline about 0, or its derivative, by scipy."""
    knots = np.arange(order + 2) - 0.5 * (order + 1)
    element = BSpline.basis_element(knots, extrapolate=False)
    read = element.derivative(derivative) if derivative else element
    return lambda x: np.nan_to_num(read(x))


def dense_minimum(values, order, smoothing):
    """Coefficients of the spline that minimises the functional over one period of the mirrored data.

    The penalty's integral is taken by Gauss–Legendre on each half node, where the integrand is a polynomial.
    """
    n, m = len(values), (order + 1) // 2
    mirrored = np.concatenate([values, values[-2:0:-1]])
    period = len(mirrored)
    read = np.zeros((period, period))
    abscissae, weights = np.polynomial.legendre.leggauss(order + 1)
    halves = np.arange(0.0, period, 0.5)
    points = (halves[:, np.newaxis] + 0.25 * (abscissae + 1.0)).ravel()
    shares = np.tile(0.25 * weights, len(halves))
    curved = np.zeros((len(points), period))
    for node in range(period):
        for turn in range(-3 - 8 // period, 4 + 8 // period):
            read[:, node] += basis(order)(np.arange(period) - node + turn * period)
            curved[:, node] += basis(order, m)(points - node + turn * period)
    normal = read.T @ read + smoothing * curved.T @ (shares[:, np.newaxis] * curved)
    return np.linalg.solve(normal, read.T @ mirrored)[:n]


@pytest.mark.parametrize("order", range(2, 6))
@given(shape=SHAPES, seed=SEEDS)
@settings(max_examples=effort(20, 25), deadline=None)
def test_without_smoothing_equals_scipys(order, shape, seed):
    values = np.random.default_rng(seed).uniform(-1.0, 1.0, shape)
    expected = values
    for axis in range(values.ndim):
        expected = spline_filter1d(expected, order, axis, mode="mirror")
    assert np.abs(prefilter(values, order) - expected).max() < 1e-12


@pytest.mark.parametrize("order", range(2, 7))
@given(n=st.integers(2, 14), smoothing=st.one_of(st.just(0.0), SMOOTHINGS), seed=SEEDS)
@settings(max_examples=10, deadline=None)
def test_is_the_minimum_of_the_smoothing_functional(order, n, smoothing, seed):
    values = np.random.default_rng(seed).uniform(-1.0, 1.0, n)
    expected = dense_minimum(values, order, smoothing)
    assert np.abs(prefilter(values, order, smoothing) - expected).max() < 1e-11 * (1.0 + smoothing)


@pytest.mark.parametrize("order", range(2, 7))
@pytest.mark.parametrize("smoothing", [0.0, 0.01, 1.0, 30.0])
def test_far_from_the_rim_it_is_the_recursive_filter_of_its_poles(order, smoothing):
    """The answer to one node of 1 decays as the poles say: the roots of the denominator inside the circle."""
    numerator, denominator = symbols(order, smoothing)
    roots = np.roots(denominator)
    poles = roots[np.abs(roots) < 1.0]
    recursion = np.poly(poles).real
    assert len(poles) == len(denominator) // 2
    line = np.zeros(401)
    line[200] = 1.0
    answer = prefilter(line, order, smoothing)
    first = 201 + len(numerator) // 2
    parts = [factor * answer[first + len(poles) - k : 330 - k] for k, factor in enumerate(recursion)]
    assert np.abs(answer[first : first + 8]).max() > 1e-5
    assert np.abs(sum(parts)).max() < 1e-14 * np.abs(recursion).sum() * 30


@pytest.mark.parametrize("order", range(2, 7))
def test_axes_are_filtered_in_turn(order):
    values = np.random.default_rng(0).uniform(-1.0, 1.0, (34, 5, 40))
    expected = values
    for axis in range(3):
        expected = np.apply_along_axis(prefilter, axis, expected, order, 0.4)
    assert np.abs(prefilter(values, order, 0.4) - expected).max() < 1e-13


@pytest.mark.parametrize("order", range(2, 7))
@given(smoothing=st.one_of(st.just(0.0), st.floats(-6.0, 6.0).map(lambda log: 10.0**log)))
@settings(max_examples=20, deadline=None)
def test_a_constant_is_its_own_spline(order, smoothing):
    assert prefilter(np.full((9, 70), 3.0), order, smoothing) == pytest.approx(3.0, rel=1e-7)


def test_strong_smoothing_gives_the_mean():
    values = np.random.default_rng(0).uniform(0.0, 1.0, 12)
    weights = np.array([0.5, *[1.0] * 10, 0.5])
    smooth = prefilter(values, 3, MAX_SMOOTHING)
    assert smooth == pytest.approx(np.average(values, weights=weights), abs=1e-3)


def test_unfiltered_values_are_unchanged():
    values = np.random.default_rng(0).uniform(0.0, 1.0, (4, 1))
    assert np.array_equal(prefilter(values, 1), values)
    assert np.array_equal(prefilter(values.T[:, :1], 5), values.T[:, :1])
    before = values.copy()
    prefilter(values, 3)
    assert np.array_equal(values, before)


@pytest.mark.parametrize("order", range(1, 8))
def test_sampled_bsplines_are_scipys(order):
    reach = order // 2
    samples = sampled_bspline(order)
    assert len(samples) == 2 * reach + 1
    assert samples == pytest.approx(basis(order)(np.arange(-reach, reach + 1.0)), abs=1e-15)


@pytest.mark.parametrize("order", [0, 7, 2.5, "3"])
def test_other_orders_are_rejected(order):
    with pytest.raises(InvalidInput, match="order"):
        prefilter(np.ones(4), order)


@pytest.mark.parametrize("smoothing", [-1e-9, float("nan"), 2e6])
def test_smoothing_off_its_range_is_rejected(smoothing):
    with pytest.raises(InvalidInput, match=r"smoothing.*1e\+06"):
        prefilter(np.ones(4), 3, smoothing)


def smooth_field(shape):
    grids = np.meshgrid(*[np.arange(n) / 6.0 for n in shape], indexing="ij")
    return sum(np.sin(grid + k) for k, grid in enumerate(grids))


def missed(volume, order, smoothing):
    """Root of the mean squared residual, the outer nodes counted half."""
    nodes = np.argwhere(np.ones(volume.shape)).astype(float)
    left = volume - Spline(volume, order, smoothing=smoothing).value(nodes).reshape(volume.shape)
    weights = np.ones(())
    for n in volume.shape:
        weights = np.multiply.outer(weights, np.where(np.arange(n) % (n - 1) == 0, 0.5, 1.0))
    return np.sqrt(np.average(left**2, weights=weights))


@pytest.mark.parametrize("order", range(2, 7))
@given(
    shape=st.lists(st.integers(4, 14), min_size=1, max_size=3).map(tuple),
    share=st.floats(0.02, 0.6),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=10, deadline=None)
def test_the_residual_equals_the_noise(order, shape, share, seed):
    volume = np.random.default_rng(seed).normal(size=shape) + 5.0
    sigma = share * volume.std()
    smoothing = smoothing_for_noise(volume, order, sigma)
    if 0.0 < smoothing < MAX_SMOOTHING:
        assert missed(volume, order, smoothing) == pytest.approx(sigma, rel=1e-5)
    else:
        assert smoothing == MAX_SMOOTHING
        assert missed(volume, order, MAX_SMOOTHING) <= sigma


@pytest.mark.parametrize("order", range(2, 7))
def test_the_truth_comes_nearer(order):
    truth = smooth_field((24, 20, 22))
    noisy = truth + 0.1 * np.random.default_rng(0).normal(size=truth.shape)
    nodes = np.argwhere(np.ones(truth.shape)).astype(float)
    smoothing = smoothing_for_noise(noisy, order, 0.1)
    result = Spline(noisy, order, smoothing=smoothing).value(nodes).reshape(truth.shape)
    assert np.sqrt(np.mean((result - truth)[2:-2, 2:-2, 2:-2] ** 2)) < 0.05


def test_zero_noise_gives_no_smoothing_and_pure_noise_full_smoothing():
    volume = smooth_field((12, 12))
    assert smoothing_for_noise(volume, 3, 0.0) == 0.0
    assert smoothing_for_noise(volume, 3, 100.0) == MAX_SMOOTHING


@given(sigma=st.floats(1e-3, 1e2), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_the_noise_of_a_smooth_field_is_found(sigma, seed):
    shape = (20, 22, 21)
    volume = 10.0 * sigma * smooth_field(shape) + sigma * np.random.default_rng(seed).normal(size=shape)
    assert noise_of(volume) == pytest.approx(sigma, rel=0.12)


def test_whole_numbers_have_at_least_the_noise_of_rounding():
    flat = np.full((5, 5, 5), 7, np.uint8)
    assert noise_of(flat) == ROUNDING == pytest.approx(12**-0.5)
    assert noise_of(flat.astype(float)) == 0.0
    steps = np.rint(20 * smooth_field((30, 30, 30))).astype(np.int16)
    assert noise_of(steps) == pytest.approx(ROUNDING, rel=0.15)
    assert smoothing_for_noise(steps, 3) == pytest.approx(smoothing_for_noise(steps, 3, noise_of(steps)))


def test_the_response_is_the_fourier_transform():
    """The prefilter acts on a long line with a 1 in its middle."""
    numerator, denominator = symbols(4, 0.5)
    line = np.zeros(129)
    line[64] = 1.0
    coefficients = Spline(line, 4, smoothing=0.5).coefficients[2:131]
    for frequency in (0.0, 0.7, 2.0, np.pi):
        waves = np.cos(frequency * (np.arange(129) - 64))
        factor = response(numerator, np.array([frequency])) / response(denominator, np.array([frequency]))
        assert factor[0] == pytest.approx(waves @ coefficients, abs=1e-12)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ({"sigma": -0.1}, "sigma: found -0.1"),
        ({"sigma": math.nan}, "sigma: found nan"),
        ({"sigma": math.inf}, "sigma: found inf"),
        ({"order": 7}, "order: found 7"),
        ({"order": 1}, "order: found 1"),
        ({"volume": np.ones((1, 5, 5))}, r"volume: found shape \(1, 5, 5\)"),
        ({"volume": np.ones((1, 5, 5)), "sigma": None}, r"volume: found shape \(1, 5, 5\)"),
        ({"volume": np.ones((2, 5, 5)), "sigma": None}, r"volume: found shape \(2, 5, 5\).*three"),
        ({"volume": np.float64(3.0)}, r"volume: found shape \(\)"),
        ({"volume": np.full((4, 4), np.nan)}, "volume: found values that are not finite"),
        ({"volume": np.full((4, 4), np.inf), "sigma": None}, "volume: found values that are not finite"),
    ],
)
def test_rejects_unreachable_noise_levels(words, named):
    with pytest.raises(InvalidInput, match=named):
        smoothing_for_noise(**{"volume": np.ones((4, 4)), "order": 3, "sigma": 0.1} | words)


def test_rejects_data_without_a_noise_level():
    with pytest.raises(InvalidInput, match=r"volume.*\(2, 5\)"):
        noise_of(np.ones((2, 5)))

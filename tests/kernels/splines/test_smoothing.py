"""Smoothing that fits the noise: the residual, and the estimated noise level."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.rendering_limits import MAX_SMOOTHING
from bentray_kernels.splines import Spline, noise_of, smoothing_for_noise
from bentray_kernels.splines.prefilter import symbols
from bentray_kernels.splines.smoothing import ROUNDING, response


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

"""Noise has the requested strength, and is repeatable."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.errors import InvalidInput

DATA = np.random.default_rng(0).normal(1e-6, 1e-6, (80, 90))
WHERE = np.ones(DATA.shape, bool)
WHERE[::7] = False


@given(snr=st.floats(0.5, 1000.0), seed=st.integers(0, 99))
def test_ratio_is_that_of_signal_and_noise(snr, seed):
    noisy, sigma = with_noise(DATA, snr, np.random.default_rng(seed), WHERE)
    signal = np.sqrt((DATA[WHERE] ** 2).mean())
    assert sigma == pytest.approx(signal / snr)
    assert (noisy - DATA)[WHERE].std() == pytest.approx(sigma, rel=0.06)
    assert np.array_equal(noisy[~WHERE], DATA[~WHERE])
    assert np.array_equal(noisy, with_noise(DATA, snr, np.random.default_rng(seed), WHERE)[0])


@pytest.mark.parametrize("snr", [0.0, -1.0, float("inf"), float("nan")])
def test_bad_ratios_are_rejected(snr):
    with pytest.raises(InvalidInput, match="snr"):
        with_noise(DATA, snr, np.random.default_rng(0), WHERE)


def test_zero_signal_gets_no_noise():
    assert with_noise(DATA, 10.0, np.random.default_rng(0), np.zeros(DATA.shape, bool))[1] == 0.0

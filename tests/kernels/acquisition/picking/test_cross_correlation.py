"""The likeliest delay over a wide range: a pulse wins over noise, and the rim is no answer."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition.picking.cross_correlation import find_delay

from ....effort import effort
from ..traces import ricker

PERIOD = 8.0


def trace(position: float, length: int = 240) -> np.ndarray:
    return ricker((np.arange(length) - position) / PERIOD, 1.0)


@given(shift=st.floats(-28.0, 28.0), gain=st.floats(0.01, 100.0), seed=st.integers(0, 99))
@settings(max_examples=effort(20, 40), deadline=None)
def test_the_pulse_is_found_anywhere_in_noise(shift, gain, seed):
    noise = 0.1 * np.random.default_rng(seed).standard_normal(240)
    delay = find_delay(trace(100.0), gain * (trace(100.0 + shift) + noise), 90, 110, -30.0, 30.0, 0.1 * gain)
    assert abs(delay - shift) <= 1.5


def test_silence_and_window_edges_give_no_delay():
    assert np.isnan(find_delay(trace(100.0), np.zeros(240), 90, 110, -30.0, 30.0, 0.0))
    assert np.isnan(find_delay(trace(100.0), trace(130.0), 90, 110, -30.0, 29.0, 0.0))


def test_an_empty_range_has_no_delay():
    assert np.isnan(find_delay(trace(100.0), trace(100.0), 90, 110, 5.0, -5.0, 0.0))

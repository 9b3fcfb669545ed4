"""Measures of traces: the envelope is that of the analytic signal."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.signal import hilbert

from bentray_kernels.acquisition.quality.measures import Measures, _envelope

from ..traces import FREQUENCY_HZ, RATE_HZ, ricker, scan


@pytest.mark.parametrize("start_s", [-4e-6, 0.0, 1e-5])
def test_the_maximum_of_a_pulse_is_at_its_time_after_the_time_zero(start_s):
    dataset = replace(scan(elements=4), t0_s=start_s)
    time = start_s + np.arange(200) / RATE_HZ
    at = start_s + np.array([6e-6, 9.03e-6, 12.51e-6])
    measures = Measures.from_traces([7.0 + ricker(time - at[:, None], FREQUENCY_HZ)], dataset)
    assert measures.strongest_s[0] == pytest.approx(at, abs=0.02 / RATE_HZ)
    assert measures.detected.all()
    assert not (measures.broken | measures.constant | measures.clipped).any()
    assert measures.peak[0] == pytest.approx(1.0, abs=0.1)


@given(
    hnp.arrays(np.float64, st.tuples(st.integers(1, 3), st.integers(1, 40)), elements=st.floats(-1e3, 1e3))
)
def test_the_envelope_is_that_of_scipy(traces):
    np.testing.assert_allclose(_envelope(traces), np.abs(hilbert(traces, axis=1)), atol=1e-9)


def test_a_tone_has_a_flat_one():
    tone = np.sin(2 * np.pi * 5 * np.arange(100) / 100)[None]
    assert _envelope(tone) == pytest.approx(np.ones((1, 100)))

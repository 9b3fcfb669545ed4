"""Measures of traces: the envelope is that of the analytic signal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.signal import hilbert

from bentray_kernels.acquisition.quality.measures import _envelope


@given(
    hnp.arrays(np.float64, st.tuples(st.integers(1, 3), st.integers(1, 40)), elements=st.floats(-1e3, 1e3))
)
def test_the_envelope_is_that_of_scipy(traces):
    np.testing.assert_allclose(_envelope(traces), np.abs(hilbert(traces, axis=1)), atol=1e-9)


def test_a_tone_has_a_flat_one():
    tone = np.sin(2 * np.pi * 5 * np.arange(100) / 100)[None]
    assert _envelope(tone) == pytest.approx(np.ones((1, 100)))

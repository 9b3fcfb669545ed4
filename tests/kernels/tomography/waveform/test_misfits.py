"""Misfits: derivatives against differences, invariances, silent traces, windows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.tomography.waveform import misfits

MEASURES = (misfits.correlation, misfits.least_squares)


@given(seed=st.integers(0, 2**32 - 1), measure=st.sampled_from(MEASURES))
def test_derivative_is_that_of_finite_differences(seed, measure):
    rng = np.random.default_rng(seed)
    simulated, recorded, way = rng.standard_normal((3, 4, 20))
    weight = rng.uniform(0.1, 1.0, (4, 20))
    small = 1e-5
    rise = (
        measure(simulated + small * way, recorded, weight)[0]
        - measure(simulated - small * way, recorded, weight)[0]
    )
    assert (measure(simulated, recorded, weight)[1] * way).sum() == pytest.approx(
        rise / (2.0 * small), rel=1e-5, abs=1e-8
    )


@pytest.mark.parametrize("measure", MEASURES)
def test_equal_traces_have_zero_misfit(measure):
    traces = np.random.default_rng(1).standard_normal((3, 30))
    value, slope = measure(traces, traces, np.ones((3, 1)))
    assert value == pytest.approx(0.0, abs=1e-14)
    assert np.abs(slope).max() < 1e-14


def test_correlation_is_blind_to_the_size_of_each_trace():
    rng = np.random.default_rng(2)
    simulated, recorded = rng.standard_normal((2, 3, 30))
    factor = np.array([[0.1], [3.0], [40.0]])
    misfit = misfits.correlation(simulated, recorded, np.ones((3, 1)))[0]
    assert misfits.correlation(simulated, factor * recorded, np.ones((3, 1)))[0] == pytest.approx(misfit)


def test_silent_traces_have_zero_misfit():
    traces = np.random.default_rng(3).standard_normal((3, 30))
    silent = traces.copy()
    silent[1] = 0.0
    for a, b in ((traces, silent), (silent, traces)):
        value, slope = misfits.correlation(a, b, np.ones((3, 1)))
        assert np.isfinite(value)
        assert np.isfinite(slope).all()
        assert not slope[1].any()


def test_window_holds_the_arrival_and_ends():
    times = np.arange(100.0)
    result = misfits.arrival_window(np.array([40.0]), times, 20.0, 30.0)[0]
    assert (result[26:62] == 1.0).all()
    assert not result[:20].any()
    assert not result[71:].any()

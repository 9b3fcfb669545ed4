"""Onsets by energy: they move with the pulse, by fractions of a sample, and do not depend on its unit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition.picking.energy_onsets import energy_ratio, risen, sta_lta

from ..traces import ricker

PERIOD = 8.0


def trace(position: float) -> np.ndarray:
    return ricker((np.arange(200) - position) / PERIOD, 1.0)


@pytest.mark.parametrize("onset", [energy_ratio, sta_lta])
@given(shift=st.integers(0, 30), gain=st.floats(1e-3, 1e3))
@settings(max_examples=20, deadline=None)
def test_an_onset_moves_with_the_pulse_and_not_with_the_unit(onset, shift, gain):
    first = onset(trace(90.0), 40, 96, PERIOD)
    moved = onset(gain * trace(90.0 + shift), 40 + shift, 96 + shift, PERIOD)
    assert moved - first == pytest.approx(shift, abs=1e-6)
    assert 90.0 - 1.5 * PERIOD < first < 90.0 + 0.25 * PERIOD


@pytest.mark.parametrize("onset", [energy_ratio, sta_lta])
@given(part=st.floats(0.0, 1.0))
@settings(max_examples=20, deadline=None)
def test_fractions_of_a_sample_are_followed(onset, part):
    first = onset(trace(90.0), 40, 97, PERIOD)
    assert onset(trace(90.0 + part), 40, 97, PERIOD) - first == pytest.approx(part, abs=0.5)


@pytest.mark.parametrize("onset", [energy_ratio, sta_lta])
def test_silence_and_too_few_samples_have_none(onset):
    assert np.isnan(onset(np.zeros(100), 10, 90, PERIOD))
    assert np.isnan(onset(trace(90.0), 88, 91, PERIOD))


def test_signals_that_start_high_have_no_onset():
    assert np.isnan(risen(np.array([1.0, 0.4, 0.8]), 0))
    assert risen(np.array([0.0, 0.25, 0.75, 1.0]), 0) == pytest.approx(1.5)

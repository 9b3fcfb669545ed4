"""The time budget decides bands and emitters of a refinement, and never more than it allows."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.numerics import BANDS
from bentray_kernels.tomography.waveform.automatic_settings import (
    MIN_EMITTERS,
    WaveScale,
)

SCALE = WaveScale(centre_hz=4e5, water_mps=1500.0, width_m=0.2, record_s=2e-4, slices=2)
WAVEFORM = Settings(method="waveform")


def within(minutes, **fixed):
    return SCALE.budgeted(WAVEFORM.changed(minutes=minutes, **fixed))


def test_without_a_budget_all_bands_are_used():
    assert within(None) == WAVEFORM
    assert len(SCALE.bands(WAVEFORM)) == BANDS + 1


@given(st.floats(0.0, 1e4))
def test_chosen_settings_fit_the_budget_or_are_minimal(minutes):
    result = within(minutes)
    least = (1, MIN_EMITTERS)
    assert SCALE.minutes(result) <= minutes or (result.numerics.bands, result.numerics.emitters) == least
    # A larger budget never gives less.
    assert SCALE.minutes(within(2.0 * minutes)) >= SCALE.minutes(result)


def test_bands_go_before_emitters():
    whole = SCALE.minutes(WAVEFORM)
    assert within(whole).numerics.bands == BANDS
    assert within(0.99 * whole).numerics.bands < BANDS
    minutes = SCALE.minutes(WAVEFORM.changed(bands=1))
    assert (within(minutes).numerics.bands, within(minutes).numerics.emitters) == (1, None)
    assert within(0.99 * minutes).numerics.emitters == 16


@pytest.mark.parametrize("fixed", [{"bands": 3}, {"bands": 3, "emitters": 5}])
def test_fixed_bands_and_emitters_stay(fixed):
    assert within(1e-3, **fixed) == WAVEFORM.changed(minutes=1e-3, **fixed)


def test_fixed_emitters_stay_where_bands_are_chosen():
    assert within(1e-3, emitters=20).numerics.emitters == 20

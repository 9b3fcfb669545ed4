"""Settings of a refinement: bands ascend, the time budget decides them, invalid values are named."""

from dataclasses import replace
from typing import get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import ranges_of
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.numerics import BANDS
from bentray_kernels.tomography.waveform.automatic_settings import (
    MIN_EMITTERS,
    WaveScale,
)
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings, bands
from bentray_kernels.wave.simulation import MIN_POINTS_OPTIMISED

from ....extremes import EXTREMES


@given(centre=st.floats(5e4, 5e6))
def test_bands_rise_and_their_grids_carry_their_waves(centre):
    made = bands(centre)
    assert [band.high_hz for band in made] == sorted(band.high_hz for band in made)
    assert [band.smoothing_m for band in made] == sorted((b.smoothing_m for b in made), reverse=True)
    for band in made:
        assert 1500.0 / (1.5 * band.high_hz * band.spacing_m) > MIN_POINTS_OPTIMISED


@pytest.mark.parametrize(
    "words",
    [
        {"low_hz": 0.0},
        {"high_hz": 5e4},
        {"spacing_m": 0.0},
        {"iterations": 0},
        {"emitters": 0},
        {"smoothing_m": -1.0},
    ],
)
def test_bad_bands_are_rejected(words):
    with pytest.raises(InvalidInput):
        Band(**{"low_hz": 1e5, "high_hz": 2e5, "spacing_m": 1e-3} | words)


@pytest.mark.parametrize(
    ("words", "field"),
    [
        ({"bands": ()}, "bands"),
        ({"window_s": (0.0, 1.0)}, "window_s"),
        ({"nearest_m": -1.0}, "nearest_m"),
        ({"speed_bounds_mps": (1600.0, 1400.0)}, "speed_bounds_mps"),
    ],
)
def test_bad_settings_are_rejected(words, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        WaveSettings(**{"bands": bands(4e5)} | words)


@pytest.mark.parametrize("settings", [bands(4e5)[0], WaveSettings(bands(4e5))], ids=["band", "all"])
def test_rejects_numbers_out_of_range(settings):
    numbers = {name for name, hint in get_type_hints(type(settings)).items() if hint in (int, float)}
    assert numbers == set(ranges_of(type(settings)))
    for name, within in ranges_of(type(settings)).items():
        for value in EXTREMES:
            if not within.holds(value):
                with pytest.raises(InvalidInput, match=f"^{name}: found"):
                    replace(settings, **{name: value})


@pytest.mark.parametrize("window", [(1e-5, float("nan")), (float("inf"), 1e-5)])
def test_a_window_without_end_is_rejected(window):
    with pytest.raises(InvalidInput, match="window_s"):
        WaveSettings(bands(4e5), window_s=window)


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

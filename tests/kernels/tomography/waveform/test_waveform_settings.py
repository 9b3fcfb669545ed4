"""Settings: default bands ascend, and invalid values are named."""

from dataclasses import fields, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.ranges import ranges_of
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
        ({"first_step_mps": 0.0}, "first_step_mps"),
        ({"memory": 0}, "memory"),
    ],
)
def test_bad_settings_are_rejected(words, field):
    with pytest.raises(InvalidInput) as caught:
        WaveSettings(**{"bands": bands(4e5)} | words)
    assert caught.value.field == field


@pytest.mark.parametrize("settings", [bands(4e5)[0], WaveSettings(bands(4e5))], ids=["band", "all"])
def test_rejects_numbers_out_of_range(settings):
    numbers = {field.name for field in fields(settings) if field.type in ("int", "float")}
    assert numbers == set(ranges_of(type(settings)))
    for name, within in ranges_of(type(settings)).items():
        for value in EXTREMES:
            if not within.holds(value):
                with pytest.raises(InvalidInput) as caught:
                    replace(settings, **{name: value})
                assert caught.value.field == name


@pytest.mark.parametrize("window", [(1e-5, float("nan")), (float("inf"), 1e-5)])
def test_a_window_without_end_is_rejected(window):
    with pytest.raises(InvalidInput, match="window_s"):
        WaveSettings(bands(4e5), window_s=window)

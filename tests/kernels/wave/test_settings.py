"""Settings: the default bands rise, and what is wrong is named."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.wave.settings import Band, WaveSettings, bands
from bentray_kernels.wave.simulation import LEAST_POINTS


@given(centre=st.floats(5e4, 5e6))
def test_bands_rise_and_their_grids_carry_their_waves(centre):
    found = bands(centre)
    assert [band.high_hz for band in found] == sorted(band.high_hz for band in found)
    assert [band.smoothing_m for band in found] == sorted((b.smoothing_m for b in found), reverse=True)
    for band in found:
        assert 1500.0 / (1.5 * band.high_hz * band.spacing_m) > LEAST_POINTS


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
def test_bad_bands_are_refused(words):
    with pytest.raises(InvalidInput):
        Band(**{"low_hz": 1e5, "high_hz": 2e5, "spacing_m": 1e-3} | words)


@pytest.mark.parametrize(
    ("words", "field"),
    [
        ({"bands": ()}, "bands"),
        ({"misfit": "phase"}, "misfit"),
        ({"window_s": (0.0, 1.0)}, "window_s"),
        ({"nearest_m": -1.0}, "nearest_m"),
        ({"speed_bounds_mps": (1600.0, 1400.0)}, "speed_bounds_mps"),
        ({"first_step_mps": 0.0}, "largest_step_mps, first_step_mps"),
        ({"memory": 0}, "memory, held_out"),
        ({"variation": -0.1}, "variation"),
    ],
)
def test_bad_settings_are_refused(words, field):
    with pytest.raises(InvalidInput) as caught:
        WaveSettings(**{"bands": bands(4e5)} | words)
    assert caught.value.field == field

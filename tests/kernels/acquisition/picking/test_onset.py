"""Onsets and delays of single traces: to a fraction of a sample, and missing where there is no pulse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition.picking.cross_correlation import find_delay, match_pulse
from bentray_kernels.acquisition.picking.differential import MIN_CORRELATION
from bentray_kernels.acquisition.picking.energy_onsets import energy_ratio, risen, sta_lta
from bentray_kernels.acquisition.picking.onset import AIC_FLOOR, aic, prepare, threshold
from bentray_kernels.acquisition.picking.pickers import AIC, ENERGY_RATIO, STA_LTA, THRESHOLD, onset

from ....effort import effort
from ..traces import ricker

PERIOD = 8.0


def trace(position: float, length: int = 200) -> np.ndarray:
    return ricker((np.arange(length) - position) / PERIOD, 1.0)


@given(shift=st.floats(-12.0, 12.0))
@settings(max_examples=effort(20, 30), deadline=None)
def test_the_match_finds_a_shift_to_a_hundredth_of_a_sample(shift):
    delay, correlation = match_pulse(trace(90.0), 0.3 * trace(90.0 + shift), 82, 98, shift + 2.0, 4.0)
    assert delay == pytest.approx(shift, abs=0.01)
    assert correlation > 0.99


def test_match_rejects_shifts_beyond_its_window():
    rising, _ = match_pulse(trace(90.0), trace(94.0), 82, 98, 0.0, 2.0)
    assert np.isnan(rising)
    _, correlation = match_pulse(trace(90.0), trace(97.0), 82, 98, 0.0, 2.0)
    assert correlation < MIN_CORRELATION


@pytest.mark.parametrize("picker", [AIC, THRESHOLD, ENERGY_RATIO, STA_LTA])
@given(shift=st.floats(0.0, 40.0))
@settings(max_examples=effort(20, 30), deadline=None)
def test_an_onset_moves_with_the_pulse(picker, shift):
    first, _ = onset(trace(90.0), 40, 120, PERIOD, 0.0, picker)
    moved, strong = onset(trace(90.0 + shift), 40, 160, PERIOD, 0.0, picker)
    assert moved - first == pytest.approx(shift, abs=1.0)
    assert strong == pytest.approx(90.0 + shift, abs=1.0)


@pytest.mark.parametrize("picker", [AIC, THRESHOLD, ENERGY_RATIO, STA_LTA])
def test_a_later_stronger_pulse_does_not_hide_the_first(picker):
    alone, _ = onset(trace(60.0), 20, 180, PERIOD, 0.0, picker)
    both, _ = onset(trace(60.0) + 1.6 * trace(120.0), 20, 180, PERIOD, 0.0, picker)
    assert both == pytest.approx(alone, abs=1.5)


@pytest.mark.parametrize("picker", [AIC, THRESHOLD, ENERGY_RATIO, STA_LTA])
def test_silence_has_no_onset(picker):
    sample, strong = onset(np.zeros(100), 10, 90, PERIOD, 0.0, picker)
    assert np.isnan(sample)
    assert strong == -1
    faint, _ = onset(trace(50.0, 100), 10, 90, PERIOD, 0.5, picker)
    assert np.isnan(faint)


def test_an_onset_at_the_rim_of_the_window_is_none():
    assert np.isnan(threshold(trace(50.0), 50, 60, 0.0))
    assert np.isnan(aic(trace(50.0), 50, 54))


@given(seed=st.integers(0, 2**32 - 1), offset=st.floats(-5.0, 5.0), position=st.floats(70.0, 130.0))
def test_aic_is_the_split_of_the_lowest_criterion_whatever_the_offset(seed, offset, position):
    """Maeda's criterion by NumPy's variances, which do not contain the mean."""
    begin, end = 20, 180
    noisy = trace(position) + offset + 0.05 * np.random.default_rng(seed).standard_normal(200)
    part, n = noisy[begin:end], end - begin
    floor = (AIC_FLOOR * np.abs(part).max()) ** 2
    ks = np.arange(2, n - 1)
    criterion = np.array(
        [k * np.log(part[:k].var() + floor) + (n - k) * np.log(part[k:].var() + floor) for k in ks]
    )
    lowest = int(criterion.argmin())
    low, middle, high = criterion[lowest - 1 : lowest + 2]
    fraction = 0.5 * (low - high) / (low - 2.0 * middle + high)
    assert aic(noisy, begin, end) == pytest.approx(begin + ks[lowest] + fraction, abs=1e-6)


def test_offset_and_noise_come_from_before_the_arrival():
    random = np.random.default_rng(1)
    noisy = trace(150.0) + 5.0 + 0.01 * random.standard_normal(200)
    noisy[20] += 3.0
    out = np.empty(200)
    noise = prepare(noisy, 120, 0.0, out)
    assert noise == pytest.approx(0.01, rel=0.3)
    assert np.median(out[:120]) == pytest.approx(0.0, abs=1e-3)
    noisy[7] = np.nan
    assert np.isnan(prepare(noisy, 120, 0.0, out))
    assert prepare(np.zeros(200, np.int16), 120, 0.29, out) == 0.29


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


@given(shift=st.floats(-28.0, 28.0), gain=st.floats(0.01, 100.0), seed=st.integers(0, 99))
@settings(max_examples=effort(20, 40), deadline=None)
def test_the_pulse_is_found_anywhere_in_noise(shift, gain, seed):
    noise = 0.1 * np.random.default_rng(seed).standard_normal(200)
    delay = find_delay(trace(100.0), gain * (trace(100.0 + shift) + noise), 90, 110, -30.0, 30.0, 0.1 * gain)
    assert abs(delay - shift) <= 1.5


def test_silence_and_window_edges_give_no_delay():
    assert np.isnan(find_delay(trace(100.0), np.zeros(200), 90, 110, -30.0, 30.0, 0.0))
    assert np.isnan(find_delay(trace(100.0), trace(130.0), 90, 110, -30.0, 29.0, 0.0))


def test_an_empty_range_has_no_delay():
    assert np.isnan(find_delay(trace(100.0), trace(100.0), 90, 110, 5.0, -5.0, 0.0))

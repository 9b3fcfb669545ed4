"""Log ratios from gated traces: of pulses that lost exactly so much, of any height, and under noise."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Waveform
from bentray_kernels.acquisition.picking.amplitudes import (
    MAX_UNCERTAINTY_NP,
    WAYS,
    Powers,
    read_log_ratios,
    with_log_ratios,
)
from bentray_kernels.acquisition.picking.gate import Gate
from bentray_kernels.errors import InvalidInput

from ..traces import FREQUENCY_HZ, RATE_HZ, START_S, absorbed, scan

ELEMENTS, DELAY_S = 10, 2.3e-7
EVERY = np.arange(ELEMENTS)
APART = EVERY[:, None] != EVERY


@cache
def plain():
    return scan(DELAY_S, elements=ELEMENTS)


def heard(loss_np, way, *, height=1.0, noise=0.0, seed=0, **changes):
    """Log ratios of the scan whose object takes so much at the centre frequency, and leaves that height."""
    random = np.random.default_rng(seed)
    traces = plain().waveform
    weak = height * absorbed(traces.object, np.broadcast_to(loss_np, APART.shape), RATE_HZ, FREQUENCY_HZ)
    both = (x + noise * random.standard_normal(x.shape) for x in (weak, traces.water))
    dataset = replace(plain(), waveform=Waveform(*(x.astype(np.float32) for x in both), **changes))
    delta = np.full(APART.shape, DELAY_S)
    return read_log_ratios(dataset, range(ELEMENTS), delta, way)


@settings(max_examples=8, deadline=None)
@given(
    loss=st.floats(0.0, 2.0),
    height=st.floats(0.05, 20.0),
    seed=st.integers(0, 2**31),
)
def test_the_spectral_ratio_gives_the_loss_at_any_height(loss, height, seed):
    """Each pair of another height, as if focused, or as if its transducers were unlike."""
    heights = height * np.exp(np.random.default_rng(seed).normal(0.0, 0.7, APART.shape))[..., None]
    computed = heard(loss, "spectrum", height=heights)
    # What the gate cuts off the pulse blurs its spectrum, and takes a part.
    assert computed[APART] == pytest.approx(loss, rel=0.1, abs=0.005)
    ratios = heard(loss, "ratio", height=heights)
    expected = np.broadcast_to(loss - np.log(heights[..., 0]), APART.shape)
    assert np.abs(ratios - expected)[APART].max() < 0.15 * loss + 0.01


@settings(max_examples=5, deadline=None)
@given(loss=st.floats(0.0, 1.5), noise=st.floats(1e-3, 0.02), seed=st.integers(0, 2**31))
@pytest.mark.parametrize("way", WAYS)
def test_noise_spreads_the_values_and_moves_their_mean_little(way, loss, noise, seed):
    ratios = heard(loss, way, noise=noise, seed=seed)[APART]
    finite = ratios[np.isfinite(ratios)]
    assert finite.size > 0.95 * ratios.size
    # At a loss of a neper the object's SNR is a third of the water's.
    spread = (10.0 if way == "spectrum" else 2.0) * noise * np.exp(loss)
    assert finite.std() < spread
    assert abs(finite.mean() - loss) < 0.13 * loss + 0.01 + 0.4 * spread


def test_frequency_independent_loss_does_not_change_the_spectral_ratio():
    assert np.abs(heard(0.0, "spectrum", height=np.exp(-1.0))[APART]).max() < 1e-3
    assert heard(0.0, "ratio", height=np.exp(-1.0))[APART] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("way", WAYS)
def test_strong_noise_drops_pairs_and_does_not_bias_them(way):
    counts = []
    for noise in (0.0, 0.05, 0.2, 1.0):
        ratios = heard(1.0, way, noise=noise)[APART]
        finite = ratios[np.isfinite(ratios)]
        counts.append(finite.size)
        if finite.size:
            assert abs(np.median(finite) - 1.0) < 2.0 * MAX_UNCERTAINTY_NP
    assert counts[0] == APART.sum()
    assert counts[-1] < 0.05 * APART.sum()
    assert sorted(counts, reverse=True) == counts


def test_the_reported_deviation_is_that_of_the_noise():
    """White noise on the values of a spectrum, independent of each other: many draws against the estimate."""
    random = np.random.default_rng(11)
    frequency = np.linspace(0.6, 1.4, 24)
    clean = np.exp(-(((frequency - 1.0) / 0.3) ** 2) / 2.0)
    level = 1e-3

    def heard_as(amplitude):
        noise = random.standard_normal((4000, 24)) + 1j * random.standard_normal((4000, 24))
        return np.abs(amplitude + np.sqrt(0.5 * level) * noise) ** 2

    noises = np.full((4000, 1), level)
    powers = Powers(heard_as(clean), heard_as(clean), noises, noises, frequency, np.eye(24))
    value, sigma = WAYS["spectrum"](powers)
    assert np.median(sigma) == pytest.approx(value.std(), rel=0.1)
    assert abs(value.mean()) < 0.1 * value.std()


def test_factors_of_single_traces_count_for_heights_only():
    random = np.random.default_rng(5)
    scales = {name: random.uniform(0.5, 2.0, APART.shape) for name in ("object_scale", "water_scale")}
    change = np.log(scales["water_scale"] / scales["object_scale"])
    for way, expected in (("ratio", change), ("spectrum", 0.0 * change)):
        moved = heard(0.5, way, **scales) - heard(0.5, way)
        np.testing.assert_allclose(moved[APART], expected[APART], atol=1e-9)


def test_pairs_without_a_time_and_slices_of_their_own():
    delta = np.full((2, *APART.shape), DELAY_S)
    delta[0, 2, 7] = np.nan
    traces = plain().waveform
    lossy = absorbed(traces.object, np.full(APART.shape, 0.8), RATE_HZ, FREQUENCY_HZ).astype(np.float32)
    both = replace(
        plain(),
        slice_z_m=np.array([0.0, 0.01]),
        delta_tof_s=delta,
        waveform=Waveform(np.stack([traces.object, lossy]), np.stack([traces.water] * 2)),
    )
    dataset = with_log_ratios(both, "spectrum")
    assert dataset.amplitude_frequency_hz == FREQUENCY_HZ
    assert np.isnan(dataset.log_ratio_np[0, 2, 7])
    assert np.isnan(np.diagonal(dataset.log_ratio_np, axis1=1, axis2=2)).all()
    assert np.abs(dataset.log_ratio_np[0][APART & np.isfinite(delta[0])]).max() < 1e-3
    assert dataset.log_ratio_np[1][APART] == pytest.approx(0.8, rel=0.1)


@pytest.mark.parametrize(
    ("changes", "way", "field"),
    [
        ({}, "height", "amplitudes"),
        ({}, "recorded", "amplitudes"),
        ({"waveform": None}, "ratio", "waveform/object"),
        ({"center_frequency_hz": None}, "spectrum", "center_frequency_hz"),
    ],
)
def test_names_missing_input(changes, way, field):
    with pytest.raises(InvalidInput, match=field):
        read_log_ratios(replace(plain(), **changes), range(ELEMENTS), np.zeros(APART.shape), way)


PERIOD = RATE_HZ / FREQUENCY_HZ


@cache
def water():
    return scan(elements=16)


def arrival(dataset):
    return (dataset.distance_m()[0] / dataset.water_speed_mps - START_S) * RATE_HZ


@pytest.mark.parametrize("periods_late", [0.0, 1.5])
def test_it_finds_the_pulse_where_the_clock_is_not_the_middle_of_it(periods_late):
    dataset = replace(water(), t0_s=START_S - periods_late / FREQUENCY_HZ)
    gate = Gate.from_dataset(dataset)
    assert gate.late == pytest.approx(-periods_late * PERIOD, abs=0.2)
    low, high = gate.frequency_hz[[0, -1]] / FREQUENCY_HZ
    # A Ricker pulse has x^4 exp(-2 x^2) of its highest power.
    for edge in (low, high):
        assert edge**4 * np.exp(2.0 - 2.0 * edge**2) == pytest.approx(0.02, rel=0.25)


def test_the_power_does_not_depend_on_fractions_of_a_sample():
    dataset = water()
    power, noise = Gate.from_dataset(dataset).powers(dataset.waveform.water[0], arrival(dataset), 0.0)
    whole = np.isfinite(power).all(axis=1)
    assert whole[1:].all()
    np.testing.assert_allclose(power[1:], np.broadcast_to(power[8], power[1:].shape), rtol=0.02)
    assert (noise[1:] < 1e-12 * power[8].max()).all()


def test_the_noise_is_the_mean_power_of_noise_alone_and_its_likeness_along_frequency():
    dataset = water()
    gate = Gate.from_dataset(dataset)
    random = np.random.default_rng(3)
    traces = 0.2 * random.standard_normal((600, dataset.waveform.water.shape[-1])).astype(np.float32)
    middle = np.full(600, 300.0)
    power, noise = gate.powers(traces, middle, 0.0)
    assert noise.mean() == pytest.approx(power.mean(), rel=0.06)
    # Powers of a Gaussian value are noise_correlation as the square of the values.
    likeness = np.corrcoef(power.T)
    far = gate.noise_correlation < 0.2
    assert np.abs(likeness[far]).max() < 0.4
    assert np.abs(likeness - gate.noise_correlation**2)[~far].max() < 0.25


def test_pulses_that_are_not_whole_have_no_power():
    dataset = water()
    gate, traces = Gate.from_dataset(dataset), dataset.waveform.water[0].copy()
    traces[3, 5] = np.nan
    points = arrival(dataset)
    points[5], points[6], points[7] = np.nan, gate.half - gate.late - 1.0, traces.shape[1] - gate.half
    power, noise = gate.powers(traces, points, 0.0)
    broken = [3, 5, 6, 7]
    assert np.isnan(power[broken]).all()
    assert np.isnan(noise[broken]).all()
    assert np.isfinite(np.delete(power, [0, *broken], axis=0)).all()


def test_water_without_a_pulse_is_rejected():
    dataset = water()
    silent = replace(dataset, waveform=Waveform(dataset.waveform.object, 0.0 * dataset.waveform.water))
    with pytest.raises(InvalidInput, match="waveform/water"):
        Gate.from_dataset(silent)

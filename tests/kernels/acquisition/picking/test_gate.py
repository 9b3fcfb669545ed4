"""Gating of a pulse: position, power spectrum, noise power, and excluded traces."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform
from bentray_kernels.acquisition.picking.gate import Gate
from bentray_kernels.errors import InvalidInput

from ..traces import FREQUENCY_HZ, RATE_HZ, START_S, scan

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

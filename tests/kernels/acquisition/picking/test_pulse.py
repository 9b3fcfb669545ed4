"""The measured pulse, its spectrum, and traces after deconvolution with it."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Waveform, pick
from bentray_kernels.acquisition.picking.pulse import AFTER, BEFORE, Inverse, measured_pulse
from bentray_kernels.acquisition.pulse_spectrum import estimate_spectrum
from bentray_kernels.errors import InvalidInput

from ..traces import FREQUENCY_HZ, RATE_HZ, ricker, scan

PERIOD = RATE_HZ / FREQUENCY_HZ


def test_the_pulse_comes_back_at_its_place_whatever_the_fractions_of_a_sample():
    pulse = measured_pulse(scan(elements=24))
    time = (np.arange(pulse.size) - BEFORE * PERIOD) / RATE_HZ
    assert pulse.size == (BEFORE + AFTER) * PERIOD
    np.testing.assert_allclose(pulse, ricker(time, FREQUENCY_HZ), atol=0.05)


def test_deconvolution_leaves_a_crest_without_phase_at_the_largest_swing():
    dataset = scan(elements=24)
    time = np.arange(48) - 20.0
    wavelet = ricker(time / RATE_HZ, FREQUENCY_HZ) + 0.6 * ricker((time - 6.0) / RATE_HZ, FREQUENCY_HZ)
    position = 100
    trace = np.zeros((1, dataset.waveform.water.shape[-1]))
    trace[0, position : position + 48] = wavelet
    filtered = Inverse.from_dataset(replace(dataset, wavelet=wavelet))(trace)[0]
    loudest = position + int(np.argmax(np.abs(wavelet)))
    assert int(np.argmax(filtered)) == loudest
    around = filtered[loudest - 60 : loudest + 61]
    np.testing.assert_allclose(around, around[::-1], atol=1e-3 * around.max())
    assert (around[52:69] ** 2).sum() > 0.8 * (around**2).sum()


def test_the_gain_is_that_of_white_noise():
    dataset = scan(elements=24)
    inverse = Inverse.from_dataset(dataset)
    noise = np.random.default_rng(0).standard_normal((40, dataset.waveform.water.shape[-1]))
    assert inverse(noise).std() == pytest.approx(inverse.gain, rel=0.1)


def test_a_broken_trace_stays_broken_and_harms_no_other():
    dataset = scan(elements=24)
    inverse = Inverse.from_dataset(dataset)
    traces = dataset.waveform.water[0].copy()
    whole = inverse(traces)
    traces[3, 50] = np.inf
    broken = inverse(traces)
    assert np.isnan(broken[3]).all()
    np.testing.assert_array_equal(np.delete(broken, 3, axis=0), np.delete(whole, 3, axis=0))


def test_a_recorded_wavelet_takes_the_place_of_the_measured_one():
    dataset = scan(2.0e-7, elements=24)
    wavelet = ricker((np.arange(40) - 17) / RATE_HZ, FREQUENCY_HZ)
    told = replace(dataset, wavelet=wavelet)
    wide = dataset.distance_m() > 0.02
    np.testing.assert_allclose(pick(told, "matched").delta_tof_s[wide], 2.0e-7, atol=0.02 / RATE_HZ)
    with pytest.raises(InvalidInput, match="acquisition/wavelet"):
        pick(replace(dataset, wavelet=np.zeros(40)), "matched")


def test_water_without_a_pulse_is_rejected():
    dataset = scan(elements=24)
    silent = replace(dataset, waveform=Waveform(dataset.waveform.object, 0 * dataset.waveform.water))
    with pytest.raises(InvalidInput, match="waveform/water"):
        measured_pulse(silent)


# Of a Ricker pulse: its power is f⁴ exp(−2 f²) in units of the frequency of its maximum.
MEAN, WIDTH = 1.064, 1.155


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_spectrum_matches_the_pulse(noise):
    traces = np.array(scan(noise=noise).waveform.object)
    # A dead emitter, a dead receiver and one without numbers do not matter.
    random = np.random.default_rng(1)
    traces[4] = noise * random.standard_normal(traces[4].shape)
    traces[:, 9] = 0.0
    traces[:, 11] = np.nan
    spectrum = estimate_spectrum(traces, RATE_HZ)
    assert spectrum.center_frequency_hz == pytest.approx(MEAN * FREQUENCY_HZ, rel=0.02)
    assert spectrum.bandwidth_hz == pytest.approx(WIDTH * FREQUENCY_HZ, rel=0.1)
    assert "estimated from the spectra of the traces" in spectrum.summary


def test_noise_alone_has_none():
    noise = np.random.default_rng(2).standard_normal((8, 8, 256))
    with pytest.raises(InvalidInput, match=r"acquisition@center_frequency_hz.*no pulse in the traces"):
        estimate_spectrum(noise, RATE_HZ)

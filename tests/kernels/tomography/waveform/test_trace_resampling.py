"""Resampling: what stays of a trace, and that the simulator's dispersion is put in."""

import numpy as np
import pytest
from scipy.special import hankel2

from bentray_kernels.tomography.waveform.trace_resampling import Clock, Water, band_pass, resampler
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import OPTIMISED, longest_step

BAND = (1e5, 2.5e5)


def test_filter_is_one_in_band_and_zero_outside():
    frequency = np.array([4e4, 5e4, 1e5, 2e5, 2.5e5, 3.2e5, 5e5])
    assert band_pass(frequency, BAND) == pytest.approx([0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0], abs=1e-12)


def test_a_wave_in_the_band_is_read_at_other_times():
    recorded = np.arange(400) * 5e-7
    clock = Clock(-1e-6, 1e-8, 19000)

    def wave(time):
        return np.exp(-(((time - 1e-4) / 2e-5) ** 2)) * np.cos(2.0 * np.pi * 1.7e5 * (time - 1e-4))

    # So short a step and so fine a grid that there is no dispersion to put in.
    computed = wave(recorded) @ resampler(recorded, clock, BAND, Water(1500.0), 2e-5)
    expected = wave(clock.begin_s + clock.step_s * np.arange(clock.steps))
    assert np.abs(computed - expected).max() < 2e-3


def test_coarse_simulations_agree_with_exact_traces_that_were_resampled():
    """Twenty wavelengths near the limit of stability: hopeless without."""
    spacing, nodes = 1.5e-3, 84
    step = 0.95 * longest_step(1500.0, spacing, order=OPTIMISED)
    recorded = np.arange(500) * 4e-7
    late = (recorded - 1.6e-5) * 2e5
    wavelet = np.exp(-((0.5 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    turn = 2.0 * np.pi * np.fft.rfftfreq(2000, 4e-7)
    green = np.zeros(turn.size, dtype=complex)
    source, receiver = np.array([0.0047, 0.0052]), np.array([[0.1173, 0.1081]])
    distance = float(np.linalg.norm(receiver[0] - source))
    green[1:] = -0.25j * hankel2(0, turn[1:] * distance / 1500.0)
    exact = np.fft.irfft(green * np.fft.rfft(wavelet, 2000), 2000)[:500]
    medium = Medium.from_speed(np.full((nodes, nodes), 1500.0), spacing, step, order=OPTIMISED)
    clock = Clock(0.0, step, int(recorded[-1] / step))

    def gap(matrix):
        computed = simulate(medium, source, receiver, (wavelet @ matrix).astype(float))[0]
        expected = exact @ matrix
        return np.sqrt(((computed - expected) ** 2).sum() / (expected**2).sum())

    assert gap(resampler(recorded, clock, BAND, Water(1500.0), spacing)) < 0.06
    # Steps and spacing of an eighth have hardly any dispersion.
    fine = Clock(0.0, step / 8, 8 * clock.steps)
    assert gap(resampler(recorded, fine, BAND, Water(1500.0), spacing / 8)[:, ::8]) > 0.2


def test_the_water_recorded_is_taken_over():
    """A lead of the recorded waves moves what is read by as much of the travel time."""
    recorded = np.arange(600) * 4e-7
    clock = Clock(0.0, 1e-7, 2300)

    def arrival(lead):
        trace = np.exp(-(((recorded - 1.2e-4) / 1e-5) ** 2)) * np.cos(
            2.0 * np.pi * 1.7e5 * (recorded - 1.2e-4)
        )
        result = trace @ resampler(recorded, clock, BAND, Water(1500.0, lead), 2e-4)
        return 1e-7 * float((np.arange(2300) * result**2).sum() / (result**2).sum())

    assert arrival(0.01) - arrival(0.0) == pytest.approx(0.01 * 1.2e-4, rel=0.05)

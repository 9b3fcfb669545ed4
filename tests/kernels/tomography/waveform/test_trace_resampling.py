"""Traces of a refinement: resampling with the dispersion of the grid, wavelet, phase of water, misfits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import hankel2

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.waveform import misfits
from bentray_kernels.tomography.waveform.trace_resampling import Clock, Water, band_pass, resampler
from bentray_kernels.tomography.waveform.water_phase import fit_water
from bentray_kernels.tomography.waveform.wavelet import fit_wavelet
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


def pulses(shift=0.0, width=4.0):
    time = np.arange(200.0)
    return np.exp(-(((time - 40.0 - shift) / width) ** 2))


def test_wavelet_is_recovered():
    rng = np.random.default_rng(0)
    green = rng.standard_normal((5, 60)) * np.exp(-np.arange(60) / 10.0)
    pulse = pulses()
    true = pulses(3.0, 6.0) - 0.5 * pulses(9.0, 6.0)

    def heard(wavelet):
        return np.stack([np.convolve(row, wavelet)[:200] for row in green])

    assert np.abs(fit_wavelet(pulse, heard(pulse), heard(true)) - true).max() < 0.02


def test_rejects_silence():
    with pytest.raises(InvalidInput, match="waveform/water"):
        fit_wavelet(pulses(), np.ones((3, 200)), np.zeros((3, 200)))


def test_a_thousandth_of_the_strongest_energy_counts_as_noise():
    """An impulse has the same energy at all frequencies, so the factor is the same at all."""
    simulated = np.zeros((1, 200))
    simulated[0, 7] = 1.0
    assert fit_wavelet(pulses(), simulated, 2.0 * simulated) == pytest.approx(
        2.0 / 1.001 * pulses(), abs=1e-9
    )


STEP, STEPS = 2.5e-7, 600
DISTANCE = np.linspace(0.04, 0.16, 40)


def traces(water):
    """Pulses after a path in such a water."""
    frequency = np.fft.rfftfreq(STEPS, STEP)
    number = 2.0 * np.pi * frequency / water.speed * (1.0 - water.lead - water.bend * frequency**2)
    pulse = np.exp(-(((frequency - 3e5) / 1e5) ** 2)) * np.exp(-2j * np.pi * frequency * 1e-5)
    return np.fft.irfft(pulse * np.exp(-1j * np.outer(DISTANCE, number)), STEPS, axis=1)


@given(lead=st.floats(-0.01, 0.01), bend=st.floats(-3e-14, 3e-14))
@settings(max_examples=20, deadline=None)
def test_lead_and_bend_are_found(lead, bend):
    plain, true = Water(1500.0), Water(1500.0, lead, bend)
    fitted = fit_water(plain, DISTANCE, traces(plain), traces(true), STEP)
    assert fitted.lead == pytest.approx(lead, abs=2e-4)
    assert fitted.bend == pytest.approx(bend, abs=2e-15)


def test_few_pairs_are_rejected():
    with pytest.raises(InvalidInput, match="8 pairs"):
        fit_water(Water(1500.0), DISTANCE[:5], np.ones((5, 20)), np.ones((5, 20)), STEP)


MEASURES = (misfits.correlation, misfits.least_squares)


@given(seed=st.integers(0, 2**32 - 1), measure=st.sampled_from(MEASURES))
def test_derivative_is_that_of_finite_differences(seed, measure):
    rng = np.random.default_rng(seed)
    simulated, recorded, way = rng.standard_normal((3, 4, 20))
    weight = rng.uniform(0.1, 1.0, (4, 20))
    small = 1e-5
    rise = (
        measure(simulated + small * way, recorded, weight)[0]
        - measure(simulated - small * way, recorded, weight)[0]
    )
    assert (measure(simulated, recorded, weight)[1] * way).sum() == pytest.approx(
        rise / (2.0 * small), rel=1e-5, abs=1e-8
    )


@pytest.mark.parametrize("measure", MEASURES)
def test_equal_traces_have_zero_misfit(measure):
    traces = np.random.default_rng(1).standard_normal((3, 30))
    value, slope = measure(traces, traces, np.ones((3, 1)))
    assert value == pytest.approx(0.0, abs=1e-14)
    assert np.abs(slope).max() < 1e-14


def test_correlation_is_blind_to_the_size_of_each_trace():
    rng = np.random.default_rng(2)
    simulated, recorded = rng.standard_normal((2, 3, 30))
    factor = np.array([[0.1], [3.0], [40.0]])
    misfit = misfits.correlation(simulated, recorded, np.ones((3, 1)))[0]
    assert misfits.correlation(simulated, factor * recorded, np.ones((3, 1)))[0] == pytest.approx(misfit)


def test_silent_traces_have_zero_misfit():
    traces = np.random.default_rng(3).standard_normal((3, 30))
    silent = traces.copy()
    silent[1] = 0.0
    for a, b in ((traces, silent), (silent, traces)):
        value, slope = misfits.correlation(a, b, np.ones((3, 1)))
        assert np.isfinite(value)
        assert np.isfinite(slope).all()
        assert not slope[1].any()


def test_window_holds_the_arrival_and_ends():
    times = np.arange(100.0)
    result = misfits.arrival_window(np.array([40.0]), times, 20.0, 30.0)[0]
    assert (result[26:62] == 1.0).all()
    assert not result[:20].any()
    assert not result[71:].any()

"""Absorption proportional to frequency: agreement with theory, stability, and the lossless case."""

import numpy as np
import pytest
from benchmarks.acquisition._absorption import Absorbing, simulate_absorbed
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import longest_step

from ..kernels.wave.test_simulation import WATER, pulse

CENTRE_HZ, STEP_S = 2e5, 2.5e-7
SOURCE = np.array([0.008, 0.015])
RECEIVERS = np.array([[0.018, 0.015], [0.043, 0.015]])
APART_M = 0.025
UNIFORM = np.full((50, 30), WATER)


def traces(loss):
    medium = Absorbing.from_speed(
        UNIFORM,
        1e-3,
        STEP_S,
        attenuation=np.full(UNIFORM.shape, loss),
        frequency_hz=CENTRE_HZ,
        dtype=np.float64,
    )
    return simulate_absorbed(medium, SOURCE, RECEIVERS, pulse(np.arange(300) * STEP_S, CENTRE_HZ))


def test_loss_and_delay_match_the_relaxation_model():
    """Against the complex wave number, by what the far trace has lost beyond the near one."""
    loss = 12.0
    frequency = np.fft.rfftfreq(4096, STEP_S)
    with_loss, without = (np.fft.rfft(traces(each), 4096) for each in (loss, 0.0))
    passed = (with_loss / without)[1] / (with_loss / without)[0]
    times = frequency / CENTRE_HZ
    # (w/c0 - i a)^2 = (w/c)^2 (1 + D / (1 + i)) at the centre.
    turn = 2.0 * np.pi * CENTRE_HZ
    square = (turn / WATER - 1j * loss) ** 2
    fast = square.real + square.imag
    wave = (
        2.0 * np.pi * frequency * np.sqrt(fast * (1.0 - 2.0 * square.imag / fast / (1.0 + 1j * times))) / turn
    )
    expected = np.exp(-1j * (wave - 2.0 * np.pi * frequency / WATER) * APART_M)
    band = (times > 0.7) & (times < 1.4)
    # The edges send a little back.
    assert np.abs(passed / expected - 1.0)[band].max() < 0.03
    lost = -np.log(np.abs(passed)) / APART_M
    assert lost[band] == pytest.approx(loss * times[band], rel=0.1)
    centre = np.argmin(np.abs(times - 1.0))
    assert lost[centre] == pytest.approx(loss, rel=0.04)
    assert abs(np.angle(passed[centre])) < 0.02


def test_zero_loss_equals_the_lossless_simulation():
    medium = Medium.from_speed(UNIFORM, 1e-3, STEP_S, dtype=np.float64)
    plain = simulate(medium, SOURCE, RECEIVERS, pulse(np.arange(300) * STEP_S, CENTRE_HZ))
    assert np.abs(traces(0.0) - plain).max() < 1e-12 * np.abs(plain).max()


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**31), most=st.floats(1.0, 100.0))
def test_rough_media_are_reciprocal_and_decay(seed, most):
    random = np.random.default_rng(seed)
    speed = random.uniform(1400.0, 1600.0, (24, 26))
    loss = random.uniform(0.0, most, speed.shape)
    step = 0.5 * longest_step(1600.0, 1e-3)
    medium = Absorbing.from_speed(
        speed, 1e-3, step, attenuation=loss, frequency_hz=CENTRE_HZ, edge_nodes=8, dtype=np.float64
    )
    wavelet = pulse(np.arange(400) * step, CENTRE_HZ)
    a, b = np.array([0.0063, 0.0184]), np.array([0.0171, 0.0057])
    there, back = (
        simulate_absorbed(medium, a, b[None], wavelet)[0],
        simulate_absorbed(medium, b, a[None], wavelet)[0],
    )
    assert np.abs(there - back).max() < 1e-9 * np.abs(there).max()
    assert np.abs(there[-50:]).max() < 1e-2 * np.abs(there).max()

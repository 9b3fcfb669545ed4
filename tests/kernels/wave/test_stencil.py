"""The stencil: exact on polynomials, stable up to its limit and not beyond, phase error as stated."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import HALO, longest_step, numerical_frequency, phase_error, symbol, weights


@pytest.mark.parametrize("degree", range(10))
def test_polynomials_up_to_degree_nine_are_differentiated_exactly(degree):
    offsets = np.arange(-HALO, HALO + 1)
    both = weights()[np.abs(offsets)]
    expected = 2.0 if degree == 2 else 0.0
    assert (both * offsets.astype(float) ** degree).sum() == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_lower_orders_are_exact_as_far_as_they_say(order):
    offsets = np.arange(-HALO, HALO + 1).astype(float)
    both = weights(order)[np.abs(offsets).astype(int)]
    for degree in range(order + 2):
        assert (both * offsets**degree).sum() == pytest.approx(2.0 if degree == 2 else 0.0, abs=1e-9)
    assert abs((both * offsets ** (order + 2)).sum()) > 0.1
    assert not weights(order)[order // 2 + 1 :].any()


def test_odd_orders_are_rejected():
    with pytest.raises(InvalidInput, match="order"):
        weights(5)


def test_degree_ten_is_not():
    offsets = np.arange(-HALO, HALO + 1)
    assert abs((weights()[np.abs(offsets)] * offsets.astype(float) ** 10).sum()) > 1.0


@given(st.floats(0.0, math.pi))
def test_symbol_stays_below_the_square_that_it_replaces(angle):
    assert float(symbol(np.array(angle))) + 1e-12 >= 0.0
    assert float(symbol(np.array(angle))) <= angle**2 + 1e-12


def grown(factor):
    """Highest pressure after 300 steps at a part of the limit, over that of a sound run."""
    speed, spacing = np.full((30, 30), 1500.0), 1e-3
    step = longest_step(1500.0, spacing)
    medium = Medium.of(speed, spacing, 0.9 * step, dtype=np.float64)
    rough = medium.__class__(
        np.full_like(medium.keep, 2.0),
        np.ones_like(medium.fade),
        np.full_like(medium.drive, (1500.0 * factor * step / spacing) ** 2),
        speed,
        spacing,
        factor * step,
        medium.margin,
    )
    time = np.arange(300) * step
    wavelet = np.exp(-(((time - 8e-6) * 2e5) ** 2))
    at = np.array([[0.012, 0.013]])
    return np.abs(simulate(rough, at[0], at + 4e-3, wavelet)).max()


def test_the_limit_of_stability_is_sharp():
    assert grown(0.999) < 1.0
    assert grown(1.02) > 1e3


def measured_lag(points):
    """Phase that a plane wave along x gains over the exact one in a wavelength, part of a turn."""
    spacing, speed = 1e-3, 1500.0
    frequency = speed / (points * spacing)
    number = np.linspace(0.5, 1.5, 4001) * 2.0 * np.pi * frequency / speed
    found = np.interp(2.0 * np.pi * frequency, speed * np.sqrt(symbol(number * spacing)) / spacing, number)
    return found * speed / (2.0 * np.pi * frequency) - 1.0


@pytest.mark.parametrize(("points", "least", "most"), [(3, 2.0e-2, 2.5e-2), (4, 3e-3, 4e-3), (5, 6e-4, 8e-4)])
def test_phase_error_is_the_stated_one(points, least, most):
    assert least < -phase_error(points) < most


@pytest.mark.parametrize("points", [4, 5, 6])
def test_phase_error_is_what_the_stencil_does_to_a_wave(points):
    assert measured_lag(points) == pytest.approx(-phase_error(points), rel=0.05)


def test_turning_is_the_speed_times_the_number_of_long_waves():
    number = np.array([10.0, 20.0])
    assert numerical_frequency(number, 1500.0, 1e-3, 1e-8) == pytest.approx(1500.0 * number, rel=1e-8)


def test_turning_has_the_error_of_the_phase():
    number, spacing, step = 2.0 * np.pi / (4.0 * 1e-3), 1e-3, 2e-7
    mean = np.mean([phase_error(4.0, 0.3, angle) for angle in np.linspace(0.0, np.pi / 2, 91)])
    assert numerical_frequency(np.array(number), 1500.0, spacing, step) == pytest.approx(
        1500.0 * number * (1.0 + mean), rel=2e-4
    )

"""The stencil: exact on polynomials, stable up to its limit, phase error as stated; reading between nodes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from bentray_kernels.errors import InvalidInput
from bentray_kernels.wave import points
from bentray_kernels.wave.medium import Medium, _sponge
from bentray_kernels.wave.simulation import simulate
from bentray_kernels.wave.stencil import (
    HALO,
    OPTIMISED,
    OPTIMISED_NODES,
    longest_step,
    numerical_frequency,
    phase_error,
    symbol,
    weights,
)


@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_polynomials_are_differentiated_exactly_as_far_as_the_order_says(order):
    offsets = np.arange(-HALO, HALO + 1).astype(float)
    both = weights(order)[np.abs(offsets).astype(int)]
    for degree in range(order + 2):
        assert (both * offsets**degree).sum() == pytest.approx(2.0 if degree == 2 else 0.0, abs=1e-9)
    assert abs((both * offsets ** (order + 2)).sum()) > 0.1
    assert not weights(order)[order // 2 + 1 :].any()
    np.testing.assert_array_equal(weights(), weights(8))


@pytest.mark.parametrize("order", [5, 0, 10, "best", 8.0])
def test_other_orders_are_rejected(order):
    with pytest.raises(InvalidInput, match="order"):
        weights(order)


def test_optimised_weights_have_the_least_largest_error():
    """A linear program: least bound of the relative error of the symbol, for waves of 3 nodes and more."""
    angle = np.linspace(0.0, 2.0 * math.pi / OPTIMISED_NODES, 2001)[1:, None]
    distance = np.arange(1, HALO + 1)
    each, bound = 2.0 * (1.0 - np.cos(angle * distance)) / angle**2, -np.ones_like(angle)
    optimum = linprog(
        [0.0] * HALO + [1.0],
        np.block([[each, bound], [-each, bound]]),
        np.concatenate((np.ones(angle.size), -np.ones(angle.size))),
        [[*distance**2, 0.0]],
        [1.0],
        bounds=(None, None),
    )
    assert weights(OPTIMISED)[1:] == pytest.approx(optimum.x[:HALO], abs=2e-6)
    errors = [phase_error(points, order=OPTIMISED) for points in np.linspace(OPTIMISED_NODES, 30.0, 400)]
    assert np.abs(errors).max() == pytest.approx(0.5 * optimum.x[HALO], rel=0.01)
    assert np.abs(errors).max() < 0.04 * abs(phase_error(OPTIMISED_NODES))


@given(st.floats(0.0, math.pi))
def test_symbol_stays_below_the_square_that_it_replaces(angle):
    assert float(symbol(np.array(angle))) + 1e-12 >= 0.0
    assert float(symbol(np.array(angle))) <= angle**2 + 1e-12


def grown(factor, order):
    """Highest pressure after 300 steps at a part of the limit, over that of a sound run."""
    speed, spacing = np.full((30, 30), 1500.0), 1e-3
    step = longest_step(1500.0, spacing, order=order)
    medium = Medium.from_speed(speed, spacing, 0.9 * step, dtype=np.float64, order=order)
    rough = medium.__class__(
        np.full_like(medium.keep, 2.0),
        np.ones_like(medium.fade),
        np.full_like(medium.drive, (1500.0 * factor * step / spacing) ** 2),
        speed,
        spacing,
        factor * step,
        medium.margin,
        order,
    )
    time = np.arange(300) * step
    wavelet = np.exp(-(((time - 8e-6) * 2e5) ** 2))
    at = np.array([[0.012, 0.013]])
    return np.abs(simulate(rough, at[0], at + 4e-3, wavelet)).max()


@pytest.mark.parametrize("order", [2, 6, 8, OPTIMISED])
def test_the_limit_of_stability_is_sharp(order):
    assert grown(0.999, order) < 1.0
    assert grown(1.02, order) > 1e3


@given(
    speed=st.floats(300.0, 6000.0),
    spacing=st.floats(1e-5, 1e-2),
    lost=st.floats(0.0, 20.0),
    dimensions=st.sampled_from([2, 3]),
)
def test_the_limit_with_damping_is_where_the_shortest_wave_begins_to_grow(speed, spacing, lost, dimensions):
    """Von Neumann: the two factors per step of the shortest mode lie in the unit circle up to the limit."""
    damping = lost * speed / spacing
    limit = longest_step(speed, spacing, damping, dimensions)

    def growth(step):
        turn = damping * step
        curvature = dimensions * float(symbol(np.array(math.pi))) * (speed * step / spacing) ** 2
        # next = keep·now − fade·before − drive·S·now, as ``Medium`` defines them.
        now = (2.0 - turn**2 - curvature) / (1.0 + turn)
        return np.abs(np.roots([1.0, -now, (1.0 - turn) / (1.0 + turn)])).max()

    assert growth(0.999 * limit) <= 1.0 + 1e-9
    assert growth(1.001 * limit) > 1.0 + 1e-6


def test_a_lossy_medium_at_its_limit_stays_bounded():
    """Strong absorption shortens the longest step, and the medium accepts no longer one."""
    spacing, attenuation = 1e-3, np.full((30, 30), 1e4)
    damping = 1500.0 * (1e4 + _sponge((30, 30), 20).max() / spacing)
    longest = longest_step(1500.0, spacing, damping)
    assert longest < 0.5 * longest_step(1500.0, spacing)
    step = 0.99 * longest
    medium = Medium.from_speed(
        np.full((30, 30), 1500.0), spacing, step, attenuation=attenuation, edge_nodes=20, dtype=np.float64
    )
    wavelet = np.exp(-((np.arange(400) - 80.0) ** 2) / 400.0)
    at = np.array([[0.012, 0.013]])
    assert np.abs(simulate(medium, at[0], at, wavelet)).max() < 10.0
    with pytest.raises(InvalidInput, match="time_step_s"):
        Medium.from_speed(np.full((30, 30), 1500.0), spacing, 1.5 * longest, attenuation=attenuation)


def measured_lag(points):
    """Phase that a plane wave along x gains over the exact one in a wavelength, part of a turn."""
    spacing, speed = 1e-3, 1500.0
    frequency = speed / (points * spacing)
    number = np.linspace(0.5, 1.5, 4001) * 2.0 * np.pi * frequency / speed
    wave = np.interp(2.0 * np.pi * frequency, speed * np.sqrt(symbol(number * spacing)) / spacing, number)
    return wave * speed / (2.0 * np.pi * frequency) - 1.0


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


@given(
    position=st.floats(6.0, 10.0),
    points_per_wavelength=st.floats(3.5, 40.0),
    angle=st.floats(0.0, np.pi),
)
def test_a_plane_wave_is_read_between_nodes(position, points_per_wavelength, angle):
    number = 2.0 * np.pi / points_per_wavelength
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0), indexing="ij")
    kx, ky = number * np.cos(angle), number * np.sin(angle)
    result = points.points_at(np.array([[position, 8.3]]), 1.0, (20, 20), 0)
    i, j = result.first[0]
    wx, wy = result.weights[0]
    wave = np.exp(1j * (kx * x + ky * y))
    taps = 2 * points.REACH
    value = wx @ wave[i : i + taps, j : j + taps] @ wy
    assert abs(value - np.exp(1j * (kx * position + ky * 8.3))) < 8e-3


def test_an_element_on_a_node_touches_it_alone():
    computed = points.points_at(np.array([[7.0, 5.0]]), 1.0, (20, 20), 3)
    expected = np.zeros((2, 2 * points.REACH))
    expected[:, points.REACH - 1] = 1.0
    assert np.allclose(computed.weights[0], expected, atol=1e-12)
    assert computed.first[0].tolist() == [7 - 3 + 3, 5 - 3 + 3]


@pytest.mark.parametrize("position", [[-0.1, 3.0], [3.0, 19.1], [np.nan, 1.0]])
def test_elements_outside_are_rejected(position):
    with pytest.raises(InvalidInput, match="element_position_m"):
        points.points_at(np.array([position]), 1.0, (20, 20), 4)

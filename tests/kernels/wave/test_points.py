"""Elements between nodes: interpolation error of waves, and rejected positions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.wave import points


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

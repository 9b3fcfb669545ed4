"""Arrivals through a fine medium: exact in water, in two dimensions and three, absorption beside them."""

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation.fine_medium import FineMedium, read

ELEMENTS = {
    2: np.array([(0.011, 0.02), (0.09, 0.03), (0.05, 0.093), (0.07, 0.012)]),
    3: np.array([(0.011, 0.02, 0.03), (0.09, 0.03, 0.012), (0.05, 0.093, 0.04), (0.07, 0.012, 0.02)]),
}


@pytest.mark.parametrize("ndim", [2, 3])
def test_uniform_medium_is_exact(ndim):
    """A medium of one speed and one attenuation: both data are straight distances times a number."""
    elements = ELEMENTS[ndim]
    shape = (51, 51, 26)[:ndim]
    medium = FineMedium(np.full(shape, 1450.0), 0.002, 1500.0, np.full(shape, 30.0), 0.25)
    emitters = np.array([2, 0])
    delta, ratio = medium.arrivals(elements, emitters)
    distance = np.linalg.norm(elements[emitters][:, None] - elements[None], axis=-1)
    assert delta == pytest.approx(distance * (1 / 1450.0 - 1 / 1500.0), abs=1e-12)
    assert ratio == pytest.approx(distance * (30.0 - 0.25), abs=1e-9)
    assert delta[0, 2] == ratio[1, 0] == 0.0


def test_amplitudes_are_simulated_only_on_request():
    medium = FineMedium(np.full((21, 21), 1450.0), 0.005, 1500.0)
    assert medium.arrivals(ELEMENTS[2], np.array([1]))[1] is None


def test_reading_between_nodes_keeps_a_point_sources_curvature():
    """Distances from a source off the nodes, read off the nodes: linear interpolation would be 1 % off."""
    axis = np.arange(21.0)
    source, points = (
        np.array([7.3, 9.6, 4.2]),
        np.array([(8.4, 9.1, 4.7), (7.3, 9.6, 4.2), (15.5, 2.5, 12.5)]),
    )
    tof = np.linalg.norm(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1) - source, axis=-1)
    assert read(tof, 1.0, source, points) == pytest.approx(np.linalg.norm(points - source, axis=1), abs=1e-12)


def test_a_node_at_the_source_has_no_share_in_what_is_read_beside_it():
    axis, source = np.arange(9.0), np.array([3.0, 5.0])
    tof = 2.0 * np.hypot(axis[:, None] - 3.0, axis[None, :] - 5.0)
    points = np.array([(3.3, 5.4), (2.9, 4.2), (3.0, 5.0), (2.1, 5.0)])
    assert read(tof, 1.0, source, points) == pytest.approx(2.0 * np.linalg.norm(points - source, axis=1))

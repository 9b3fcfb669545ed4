"""Simulated arrays, times and amplitudes: right, reciprocal, and made on a finer grid."""

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation import array_shapes
from bentray_kernels.acquisition.simulation.fine_medium import FineMedium, log_ratios, read
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.eikonal import solve
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import Ellipse, EllipsePhantom, table6


def test_water_alone_takes_no_longer_than_water():
    scan = TravelTimeScan(disk(1500.0), Ring(16, 0.09), 0.2, nodes=32)
    assert np.abs(scan.delta_tof(np.arange(16))).max() < 1e-12


def test_fast_disk_is_early_by_its_chord():
    """Through the middle of a disk faster than the water the ray is straight: −2r(1/c_w − 1/c)."""
    scan = TravelTimeScan(disk(1540.0), Ring(8, 0.09), 0.2, nodes=64)
    delta = scan.delta_tof(np.array([0]))[0]
    assert delta[4] == pytest.approx(0.08 * (1 / 1540.0 - 1 / 1500.0), rel=0.01)
    assert delta[0] == 0.0
    assert delta[1] == pytest.approx(0.0, abs=2e-9)


def test_travel_times_are_reciprocal():
    scan = TravelTimeScan(table6(1400.0), Ring(12, 0.095), 0.2, nodes=64)
    delta = scan.delta_tof(np.arange(12))
    assert np.abs(delta - delta.T).max() < 1e-7
    assert np.abs(delta).max() > 1e-6


def test_finer_grids_agree():
    coarse = TravelTimeScan(table6(1375.0), Ring(6, 0.095), 0.2, nodes=64, refinement=4)
    fine = TravelTimeScan(table6(1375.0), Ring(6, 0.095), 0.2, nodes=64, refinement=8)
    emitters = np.array([0, 1])
    assert np.abs(coarse.delta_tof(emitters) - fine.delta_tof(emitters)).max() < 6e-8


def test_inverse_crime_is_rejected():
    with pytest.raises(InvalidInput, match="inverse crime"):
        TravelTimeScan(table6(), Ring(8, 0.09), 0.2, refinement=2)


def test_ring_must_fit():
    with pytest.raises(InvalidInput, match="radius_m"):
        TravelTimeScan(table6(), Ring(8, 0.11), 0.2)
    with pytest.raises(InvalidInput, match="elements"):
        Ring(2, 0.1)


def disk(speed, attenuation=0.0, coupling_np_m=0.0):
    ellipse = Ellipse((0.0, 0.0), (0.04, 0.04), speed, attenuation, "disk")
    return EllipsePhantom(1500.0, (ellipse,), coupling_np_m)


def test_disk_absorbs_over_its_chord():
    scan = TravelTimeScan(disk(1500.0, 25.0, 2.0), Ring(8, 0.09), 0.2, nodes=64)
    ratio = scan.medium(attenuation=True).arrivals(scan.elements(), np.array([0]))[1][0]
    chord = 2.0 * np.sqrt(0.04**2 - (0.09 * np.cos(3 * np.pi / 8)) ** 2)
    assert ratio[[4, 3]] == pytest.approx([0.08 * 23.0, chord * 23.0], rel=0.01)
    assert ratio[[0, 1, 7]] == pytest.approx(0.0, abs=1e-9)


def test_a_slow_absorber_is_gone_round():
    """First arrivals avoid a disk so slow that the way round it is shorter, and keep their amplitude."""
    scan = TravelTimeScan(disk(900.0, 25.0), Ring(8, 0.09), 0.2, nodes=64)
    ratio = scan.medium(attenuation=True).arrivals(scan.elements(), np.array([0]))[1][0]
    assert abs(ratio[4]) < 0.1 * 0.08 * 25.0


def test_amplitudes_are_reciprocal():
    scan = TravelTimeScan(table6(1375.0), Ring(12, 0.085), 0.2, nodes=64)
    ratio = scan.medium(attenuation=True).arrivals(scan.elements(), np.arange(12))[1]
    assert np.abs(ratio - ratio.T).mean() < 0.01 * ratio.max()
    assert ratio.max() > 4.0
    assert (ratio >= 0.0).all()


def test_ratios_are_linear_in_the_attenuation():
    random = np.random.default_rng(3)
    this, two = random.uniform(0.0, 60.0, (2, 41, 41))
    source, receivers = np.array([0.01, 0.05]), np.array([(0.09, 0.02), (0.05, 0.09)])
    tof = solve(random.uniform(1400.0, 1600.0, (41, 41)), 0.0025, source)
    both, first, second = (
        log_ratios(tof, field, 0.0025, receivers, source) for field in (this + 2.0 * two, this, two)
    )
    assert both == pytest.approx(first + 2.0 * second, rel=1e-12)
    assert (first > 0.0).all()


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


@pytest.mark.parametrize(("degrees", "last"), [(360.0, 270.0), (400.0, 270.0), (180.0, 180.0), (90.0, 90.0)])
def test_only_a_whole_circle_ends_before_its_first_element(degrees, last):
    shape = array_shapes.arc(4, 0.1, degrees)
    angle = np.radians(np.linspace(0.0, last, 4))
    np.testing.assert_allclose(
        shape.position_m, 0.1 * np.column_stack((np.cos(angle), np.sin(angle))), atol=1e-15
    )
    np.testing.assert_allclose(shape.normal, -shape.position_m / 0.1, atol=1e-15)


def test_facing_lines_look_at_each_other():
    shape = array_shapes.facing_lines(3, 0.06, 0.1)
    np.testing.assert_allclose(shape.position_m[:, 0], [-0.05] * 3 + [0.05] * 3)
    np.testing.assert_allclose(shape.position_m[:, 1], [-0.03, 0.0, 0.03] * 2)
    np.testing.assert_array_equal(shape.normal, [[1.0, 0.0]] * 3 + [[-1.0, 0.0]] * 3)


def test_the_elements_of_a_bowl_look_at_its_middle():
    shape = array_shapes.bowl(9, 0.1)
    np.testing.assert_allclose(shape.position_m, -0.1 * shape.normal, atol=1e-15)
    assert (shape.position_m[:, 2] < 0.0).all()

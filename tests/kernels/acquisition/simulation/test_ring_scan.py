"""Simulated arrays, times and amplitudes in planes and space: right, reciprocal, made on a finer grid."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation import array_shapes
from bentray_kernels.acquisition.simulation.fine_medium import FineMedium, log_ratios, read
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.acquisition.simulation.volume_scan import AXIAL_MARGIN_NODES, VolumeScan
from bentray_kernels.eikonal import solve
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import (
    Dome,
    Ellipse,
    EllipsePhantom,
    Ellipsoid,
    Part,
    VolumePhantom,
    table6,
    table7,
)


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


# Far below its tip a dome is a cylinder.
CYLINDER = VolumePhantom(1500.0, (Part(Dome(1.0, 2.0, (0.01, 0.0), (0.05, 0.03)), 1540.0, 20.0, "cylinder"),))
BALL = VolumePhantom(1500.0, (Part(Ellipsoid((0.0, 0.0, 0.0), (0.04, 0.04, 0.04)), 1540.0, 20.0, "ball"),))
SCAN = VolumeScan(CYLINDER, Ring(6, 0.09), (-0.01, 0.0, 0.01), 0.2, nodes=32)


def test_a_cylinder_is_the_same_in_space_as_in_its_planes():
    flat = SCAN.slice(1)
    times, amplitudes = flat.medium(attenuation=True).arrivals(flat.elements(), np.array([0, 1]))
    scan = replace(SCAN, three_d=True)
    elements = scan.elements()[6:12]
    in_space = scan.medium(attenuation=True).arrivals(elements, np.array([0, 1]))
    assert np.abs(in_space[0] - times).max() < 0.01 * np.abs(times).max()
    assert np.abs(in_space[1] - amplitudes).max() < 0.05 * amplitudes.max()
    assert amplitudes.max() > 1.0


def test_a_ball_is_crossed_obliquely_from_ring_to_ring():
    """Through the middle of a fast ball: its diameter, whatever the direction."""
    scan = replace(SCAN, phantom=BALL, three_d=True, refinement=3)
    elements = scan.elements()
    assert elements.shape == (18, 3)
    across = np.linalg.norm(elements[0] - elements[15])
    assert across == pytest.approx(np.hypot(0.18, 0.02))
    delta, ratio = scan.medium(attenuation=True).arrivals(elements, np.array([0]))
    assert delta[0, 15] == pytest.approx(0.08 * (1 / 1540.0 - 1 / 1500.0), rel=0.02)
    assert ratio[0, 15] == pytest.approx(0.08 * 20.0, rel=0.02)


def test_medium_and_elements_share_their_origin():
    scan = replace(SCAN, phantom=BALL, three_d=True, refinement=2)
    medium = scan.medium()
    middle = scan.elements().mean(axis=0) / medium.spacing
    assert medium.speed[tuple(np.rint(middle).astype(int))] == 1540.0
    shape = np.array(medium.speed.shape)
    assert ((scan.elements() >= 0.0) & (scan.elements() <= (shape - 1) * medium.spacing)).all()
    assert scan.positions().mean(axis=0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("z_m", [(0.0,), (-0.01, 0.0, 0.01), (-0.03, 0.01)])
def test_the_same_margin_lies_below_the_lowest_and_above_the_highest_element(z_m):
    scan = replace(SCAN, phantom=BALL, three_d=True, refinement=2, z_m=z_m)
    medium, height = scan.medium(), scan.elements()[:, 2]
    margin = AXIAL_MARGIN_NODES * 2 * medium.spacing
    assert height.min() == pytest.approx(margin)
    above = (medium.speed.shape[2] - 1) * medium.spacing - height.max()
    assert margin - 1e-9 <= above < margin + medium.spacing


def test_slices_of_the_breast_differ():
    scan = VolumeScan(table7(1475.0), Ring(8, 0.09), (-0.02, 0.02), 0.2, nodes=64)
    low, high = (scan.slice(k).delta_tof(np.array([0]))[0] for k in (0, 1))
    assert np.abs(low - high).max() > 0.1 * np.abs(low).max()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"z_m": ()}, "z_m"),
        ({"z_m": (0.01, 0.0)}, "z_m"),
        ({"refinement": 3}, "refinement"),
        ({"three_d": True, "refinement": 1}, "refinement"),
        ({"ring": Ring(6, 0.11)}, "radius_m"),
        ({"three_d": True, "ring": Ring(6, 0.11)}, "radius_m"),
    ],
)
def test_bad_scans_are_named(change, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        replace(SCAN, **change)

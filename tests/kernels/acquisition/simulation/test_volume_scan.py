"""Volume scans: each plane a scan of its section; in space the same where nothing changes along z."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.acquisition.simulation.volume_scan import AXIAL_MARGIN_NODES, VolumeScan
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import Dome, Ellipsoid, Part, VolumePhantom, table7

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

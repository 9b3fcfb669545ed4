"""Volume phantoms: solids in their places, exact at points, cell means that keep volumes and sections."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import Dome, Ellipse, EllipsePhantom, Ellipsoid, Part, VolumePhantom
from bentray_kernels.phantoms.averaging import plane_means

BALL = Part(Ellipsoid((0.0, 0.0, 0.0), (0.051, 0.051, 0.051)), 1400.0, 20.0, "ball")
CORE = Part(Ellipsoid((0.0, 0.0, 0.0), (0.02, 0.02, 0.02)), 1550.0, 60.0, "core")
PHANTOM = VolumePhantom(1500.0, (BALL, CORE), 0.5)


def test_points_have_the_topmost_part():
    x = np.array([0.0, 0.03, 0.06])
    assert PHANTOM.speed_at(x, 0.0, 0.0).tolist() == [1550.0, 1400.0, 1500.0]
    assert PHANTOM.at(0.03).speed_at(x, 0.0).tolist() == [1400.0, 1400.0, 1500.0]
    assert PHANTOM.speed_range() == PHANTOM.at(0.0).speed_range() == (1400.0, 1550.0)


def test_grids_and_slices_have_their_axes_in_order():
    z = np.array([-0.048, 0.0, 0.048])
    volume = PHANTOM.attenuation(21, 0.2, z)
    assert volume.shape == PHANTOM.inside(21, 0.2, z).shape == (21, 21, 3)
    assert volume[10, 10, 1] < 60.0
    assert volume[0, 0].tolist() == [0.5, 0.5, 0.5]
    assert PHANTOM.at(0.0).attenuation(21, 0.2)[10, 10] == 60.0
    assert PHANTOM.inside(21, 0.2, z).sum(axis=(0, 1)).tolist() == [9, 89, 9]


@pytest.mark.parametrize(
    ("field", "arguments"), [("coupling_mps", (0.0, ())), ("coupling_np_m", (1.0, (), -1.0))]
)
def test_bad_coupling_is_rejected(field, arguments):
    with pytest.raises(InvalidInput, match=field):
        VolumePhantom(*arguments)


def test_ellipsoid_ends_at_its_semi_axes():
    solid = Ellipsoid((1.0, 2.0, 3.0), (0.4, 0.2, 0.1), np.pi / 2)
    # A quarter turn brings the first axis to y.
    ends = np.array([(1.0, 2.4, 3.0), (1.2, 2.0, 3.0), (1.0, 2.0, 2.9)])
    assert solid.level(*ends.T) == pytest.approx(1.0)


@pytest.fixture
def dome():
    return Dome(0.0, 2.0, (0.1, 0.0), (0.5, 0.4), 2.0, (0.0, 0.3), ((3, 0.1),), 0.8)


def test_dome_narrows_to_its_tip_and_drifts_there(dome):
    plain = Dome(0.0, 2.0, (0.1, 0.0), (0.5, 0.4), 2.0, (0.0, 0.3))
    half = np.sqrt(1.0 - 0.25)
    assert plain.level(0.1 + 0.5 * half, np.array(0.3 * 0.25), np.array(1.0)) == pytest.approx(1.0)
    assert plain.level(np.array(0.6), np.array(0.0), np.array(-5.0)) == pytest.approx(1.0)
    assert np.isinf(dome.level(np.array(0.1), np.array(0.3), np.array([2.0, 3.0]))).all()


def test_waves_lift_the_radius_and_turn(dome):
    def radius(angle, z):
        """Where the level along a direction from the axis is 1: it is linear in the distance."""
        t = max(z / 2.0, 0.0)
        x, y = 0.1 + 0.5 * np.cos(angle), 0.3 * t * t + 0.4 * np.sin(angle)
        return 1.0 / dome.level(np.array(x), np.array(y), np.array(z)) / np.sqrt(1.0 - t * t)

    assert radius(0.0, 0.0) == pytest.approx(1.1)
    assert radius(np.pi / 3, 0.0) == pytest.approx(0.9)
    assert radius(0.4, 1.0) == pytest.approx(1.1)


def ball(centre, axes, angle=0.0):
    return Part(Ellipsoid(centre, axes, angle), 2.0, 1.0, "ball")


@given(
    axes=st.tuples(*[st.floats(0.15, 0.9)] * 3),
    centre=st.tuples(*[st.floats(-0.05, 0.05)] * 3),
    angle=st.floats(0.0, 3.1),
)
@settings(max_examples=15, deadline=None)
def test_a_volume_keeps_its_content(axes, centre, angle):
    phantom = VolumePhantom(1.0, (ball(centre, axes, angle),))
    nodes = 33
    step = 2.0 / (nodes - 1)
    z = np.linspace(-1.0, 1.0, nodes)
    content = (phantom.speed(nodes, 2.0, z) - 1.0).sum() * step**3
    assert content == pytest.approx(4.0 / 3.0 * np.pi * np.prod(axes), rel=0.01)


def test_a_flat_section_equals_the_ellipse_that_it_is():
    """Both average over the same points, so a section is an ellipse to rounding."""
    phantom = VolumePhantom(
        1500.0, (Part(Ellipsoid((0.01, 0.0, 0.0), (0.08, 0.05, 0.02), 0.4), 1400.0, 9.0, "a"),)
    )
    scale = np.sqrt(1.0 - 0.6**2)
    flat = EllipsePhantom(
        1500.0, (Ellipse((0.01, 0.0), (0.08 * scale, 0.05 * scale), 1400.0, 9.0, "a", 0.4),)
    )
    cut = phantom.at(0.012)
    assert cut.speed(77, 0.2) == pytest.approx(flat.speed(77, 0.2), abs=1e-9)
    assert cut.attenuation(77, 0.2) == pytest.approx(flat.attenuation(77, 0.2), abs=1e-9)
    assert np.array_equal(cut.inside(77, 0.2), flat.inside(77, 0.2))


def test_shortcut_equals_the_mean_over_all_points():
    """Overlapping solids, one smaller than a cell: as if every cell had been painted point by point."""
    parts = (ball((0.0, 0.0, 0.0), (0.7, 0.6, 0.5)), ball((0.3, 0.1, 0.0), (0.3, 0.5, 0.3), 0.7))
    phantom = VolumePhantom(
        1.0, tuple(Part(p.solid, v, 0.0, "") for p, v in zip(parts, (3.0, 7.0), strict=True))
    )
    nodes, height, z = 25, 0.1, 0.21
    axis = np.linspace(-1.0, 1.0, nodes)
    fine = (np.arange(6) + 0.5) / 6 - 0.5
    x = (axis[:, None] + fine * (axis[1] - axis[0])).ravel()
    points = phantom.speed_at(x[:, None, None], x[None, :, None], z + fine * height)
    expected = points.reshape(nodes, 6, nodes, 6, 6).mean(axis=(1, 3, 4))
    computed = plane_means([p.solid for p in parts], nodes, 2.0, z, height, phantom.speeds_mps)
    assert computed == pytest.approx(expected, abs=1e-12)
    assert len(np.unique(computed)) > 20


@pytest.mark.parametrize(
    "arguments", [(1, 0.2, [0.0, 0.1]), (8, -0.2, [0.0, 0.1]), (8, 0.2, [0.0]), (8, 0.2, [0.0, 0.1, 0.3])]
)
def test_bad_grids_are_rejected(arguments):
    with pytest.raises(InvalidInput):
        VolumePhantom(1500.0, ()).speed(*arguments)

"""Cell means: volumes kept, sections kept, nothing but boundaries blended."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import Ellipse, EllipsePhantom, Ellipsoid, Part, VolumePhantom
from bentray_kernels.phantoms.averaging import plane_means


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

"""Phantoms: exact at points, area-averaged on grids, the values of Table 6."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import (
    TABLE6_SIDE_M,
    Ellipse,
    EllipsePhantom,
    HalfEllipse,
    table6,
    table6_vertical,
)

from ...effort import effort


@given(
    axes=st.tuples(st.floats(0.2, 0.9), st.floats(0.2, 0.9)),
    centre=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)),
    angle=st.floats(0.0, 3.1),
)
@settings(max_examples=effort(20, 40), deadline=None)
def test_average_keeps_the_area(axes, centre, angle):
    phantom = EllipsePhantom(0.5, (Ellipse(centre, axes, 1.5, 1.0, "disk", angle),))
    nodes, side = 81, 2.0
    area = (phantom.speed(nodes, side) - 0.5).sum() * (side / (nodes - 1)) ** 2
    assert area == pytest.approx(np.pi * axes[0] * axes[1], rel=0.01)


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi])
def test_half_an_ellipse_is_cut_along_its_first_axis(angle):
    whole, half = (kind((0.1, -0.05), (0.6, 0.4), 1.5, 1.0, "half", angle) for kind in (Ellipse, HalfEllipse))
    x, y = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 20_000))
    x, y = x + 0.1, y - 0.05
    before = np.cos(angle) * (y + 0.05) <= np.sin(angle) * (x - 0.1)
    np.testing.assert_array_equal(half.contains(x, y), whole.contains(x, y) & before)
    assert 0.45 < half.contains(x, y).sum() / whole.contains(x, y).sum() < 0.55


def test_the_vertical_slice_hangs_from_its_cut():
    phantom = table6_vertical(1400.0)
    image, inside = phantom.speed(128, TABLE6_SIDE_M), phantom.inside(128, TABLE6_SIDE_M)
    x, y = np.nonzero(inside)
    # Widest at the chest, rounded below; water above.
    widths = [np.ptp(x[y == row]) for row in range(y.min() + 1, y.max())]
    assert (np.diff(widths) >= 0).all()
    assert widths[-1] > 0.7 * 127
    assert (image[:, y.max() + 2 :] == 1400.0).all()
    # Lesions lie in the tissue whole, and the ring of a scan around all of it.
    tissue = phantom.ellipses[1]
    angle = np.linspace(0.0, 2.0 * np.pi, 90)
    for lesion in phantom.ellipses[2:]:
        radius = max(lesion.semi_axes_m)
        around = lesion.centre_m[0] + radius * np.cos(angle), lesion.centre_m[1] + radius * np.sin(angle)
        assert tissue.contains(*around).all()
    position = (np.arange(128) / 127.0 - 0.5) * TABLE6_SIDE_M
    assert np.hypot(position[x], position[y]).max() < 0.09
    assert phantom.speed_range() == table6().speed_range()


def test_edges_are_blended_and_the_rest_is_exact():
    phantom = table6(1500.0)
    image = phantom.speed(128, TABLE6_SIDE_M)
    values, counts = np.unique(image, return_counts=True)
    pure = {1375.0, 1475.0, 1500.0, 1530.0, 1560.0}
    assert pure <= set(values)
    blended = counts[~np.isin(values, list(pure))].sum()
    assert 200 < blended < 2000
    assert image.min() == 1375.0
    assert image.max() == 1560.0
    assert image[0, 0] == 1500.0


def test_coupling_is_a_parameter_and_only_that():
    water, oil = table6(1500.0), table6(1375.0)
    inside = water.inside(64, TABLE6_SIDE_M)
    x = np.linspace(-0.1, 0.1, 64)
    a, b = (p.speed_at(x[:, None], x[None, :]) for p in (water, oil))
    assert np.array_equal(a[inside], b[inside])
    assert (a[~inside] == 1500.0).all()
    assert (b[~inside] == 1375.0).all()
    assert water.speed_range() == (1375.0, 1560.0)


def test_lesions_have_two_to_eight_pixels():
    pixel = TABLE6_SIDE_M / 127.0
    sizes = [2.0 * max(e.semi_axes_m) / pixel for e in table6().ellipses if "lesion" in e.name]
    assert min(sizes) == pytest.approx(2.0)
    assert max(sizes) == pytest.approx(8.0)


def test_attenuation_shares_the_shape():
    image = table6().attenuation(128, TABLE6_SIDE_M)
    assert {0.0, 15.0, 50.0, 60.0, 30.0, 70.0} <= set(np.unique(image))


@pytest.mark.parametrize("arguments", [(1, 0.2), (64, 0.0), (64, float("nan"))])
def test_bad_grids_are_rejected(arguments):
    with pytest.raises(InvalidInput):
        table6().speed(*arguments)


def test_bad_coupling_is_rejected():
    with pytest.raises(InvalidInput, match="coupling_mps"):
        table6(-1.0)

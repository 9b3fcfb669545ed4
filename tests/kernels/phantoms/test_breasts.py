"""Breast phantoms: the ellipses of Table 6, the volume of Table 7, and the detailed one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import (
    DENSITIES,
    DETAILED_SIDE_M,
    LARGE_LESIONS,
    TABLE6_SIDE_M,
    TABLE7_GRIDS,
    TABLE7_SIDE_M,
    DetailedBreast,
    Ellipse,
    EllipsePhantom,
    HalfEllipse,
    table6,
    table6_vertical,
    table7,
    table7_slices,
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


SLICES = table7_slices(128, 40)


def part_at(phantom, name):
    return next(part.solid for part in phantom.parts if part.name == name)


def test_values_are_those_of_the_table():
    result = {part.name: (part.speed_mps, part.attenuation_np_m) for part in table7().parts[:3]}
    assert result == {"skin": (1650.0, 58.0), "fat": (1375.0, 15.0), "tissue": (1475.0, 50.0)}
    lesions = {(part.speed_mps, part.attenuation_np_m) for part in table7().parts[3:]}
    assert lesions == {(1560.0, 60.0), (1560.0, 30.0), (1530.0, 70.0)}


@pytest.mark.parametrize(("nodes", "slices"), TABLE7_GRIDS)
def test_parts_are_nested_as_in_the_table(nodes, slices):
    phantom = table7(nodes=nodes)
    z = table7_slices(nodes, slices)
    random = np.random.default_rng(7)
    x, y = random.uniform(-0.1, 0.1, (2, 200_000))
    position = random.uniform(z[0], z[-1], x.size)
    skin, fat, tissue, *lesions = (part.solid.level(x, y, position) <= 1.0 for part in phantom.parts)
    assert fat[tissue].all()
    assert skin[fat].all()
    for k, lesion in enumerate(lesions):
        # Deep enough in the tissue, and away from every other lesion.
        centre = np.array(phantom.parts[3 + k].solid.centre_m)
        assert abs(centre[2]) < z[-1]
        assert tissue[lesion].all()
        assert not np.any([lesion & other for j, other in enumerate(lesions) if j != k])


def test_lesions_have_two_to_ten_voxels_of_their_grid():
    for nodes, _ in TABLE7_GRIDS:
        voxel = TABLE7_SIDE_M / (nodes - 1)
        sizes = [2.0 * max(p.solid.semi_axes_m) / voxel for p in table7(nodes=nodes).parts[3:]]
        assert min(sizes) == pytest.approx(2.0)
        assert max(sizes) == pytest.approx(10.0)


def test_the_smallest_lesions_show_on_the_grid():
    """A ball two voxels wide and half a voxel off the node still shows at most of its contrast."""
    near = SLICES[np.abs(SLICES) < 0.003]
    image = table7().speed(128, TABLE7_SIDE_M, near)
    smallest = [p.solid for p in table7().parts[3:] if p.solid.semi_axes_m[0] < 1.1 * TABLE7_SIDE_M / 127]
    assert len(smallest) == 3
    for solid in smallest[:2]:
        i, j = (round((c / TABLE7_SIDE_M + 0.5) * 127) for c in solid.centre_m[:2])
        assert image[i - 1 : i + 2, j - 1 : j + 2].max() > 1475.0 + 0.5 * (1530.0 - 1475.0)


def test_shape_changes_along_z_and_is_no_stretched_stack():
    phantom = table7()
    area = phantom.inside(128, TABLE7_SIDE_M, SLICES).sum(axis=(0, 1))
    assert (np.diff(area) <= 0).all()
    assert area[-1] < 0.4 * area[0]
    tissue = part_at(phantom, "tissue")
    axis = np.linspace(-0.1, 0.1, 101)
    ratios = []
    for z in SLICES[::13]:
        inside = tissue.level(axis[:, None], axis[None, :], np.array(z)) <= 1.0
        ratios.append(inside.sum() / phantom.inside(101, 0.2, [z]).sum())
    assert max(ratios) - min(ratios) > 0.1


def test_slices_are_a_node_apart_and_centred():
    assert len(SLICES) == 40
    assert np.diff(SLICES) == pytest.approx(TABLE7_SIDE_M / 127)
    assert SLICES[0] == pytest.approx(-SLICES[-1])


def test_sampling_is_repeatable_and_sees_every_material():
    volume = table7(1480.0).speed(128, TABLE7_SIDE_M, SLICES[13:22])
    again = table7(1480.0).speed(128, TABLE7_SIDE_M, SLICES[13:22])
    assert np.array_equal(volume, again)
    assert {1480.0, 1375.0, 1475.0, 1530.0, 1560.0} <= set(np.unique(volume))
    assert volume.max() > 1640.0


def test_coarse_voxels_are_rejected():
    with pytest.raises(InvalidInput, match="nodes"):
        table7(nodes=64)


BREAST = DetailedBreast(1480.0, 0.2)


def test_a_finer_grid_samples_the_same_object():
    coarse = BREAST.speed(47, DETAILED_SIDE_M)
    fine = BREAST.speed(139, DETAILED_SIDE_M)
    # Every third fine node is a coarse node; the cells differ in size alone.
    assert np.abs(gaussian_filter(coarse, 1.0) - gaussian_filter(fine[::3, ::3], 1.0)).mean() < 3.0
    assert np.array_equal(fine, BREAST.speed(139, DETAILED_SIDE_M))


def test_detail_is_finer_than_a_millimetre_of_blur():
    fine, spacing = BREAST.speed(323, DETAILED_SIDE_M), DETAILED_SIDE_M / 322
    inside = BREAST.inside(323, DETAILED_SIDE_M)
    blurred = gaussian_filter(fine, 1e-3 / spacing)
    rms = np.sqrt(((blurred - fine)[inside] ** 2).mean())
    assert 14.0 < rms < 22.0


def test_outside_is_water_and_inside_the_stated_range():
    speed, inside = BREAST.speed(93, DETAILED_SIDE_M), BREAST.inside(93, DETAILED_SIDE_M)
    assert (speed[0] == 1480.0).all()
    low, high = BREAST.speed_range()
    assert low <= speed.min() < 1450.0
    assert 1570.0 < speed.max() <= high
    assert 0.25 < inside.mean() < 0.4
    attenuation = BREAST.attenuation(93, DETAILED_SIDE_M)
    assert (attenuation[0] == 0.2).all()
    assert attenuation.max() == pytest.approx(25.0)


# Glandular parts of the classes a to d of ACR BI-RADS.
CLASSES = {
    "fatty": (0.0, 0.25),
    "scattered": (0.25, 0.5),
    "heterogeneous": (0.5, 0.75),
    "dense": (0.75, 1.0),
    "large lesions": (0.5, 0.75),
}


@pytest.mark.parametrize("name", [*DENSITIES, "large lesions"])
def test_each_density_has_its_share_of_gland_and_its_lesions(name):
    anatomy = DENSITIES.get(name, LARGE_LESIONS)
    breast = DetailedBreast(1500.0, anatomy=anatomy)
    low, high = CLASSES[name]
    assert low < breast.glandular(93, DETAILED_SIDE_M) < high
    speed, inside = breast.speed(93, DETAILED_SIDE_M), breast.inside(93, DETAILED_SIDE_M)
    axis = np.linspace(-0.5, 0.5, 93) * DETAILED_SIDE_M
    for lesion in anatomy.lesions:
        i, j = (np.abs(axis - centre).argmin() for centre in lesion.centre_m)
        assert inside[i, j]
        assert abs(speed[i, j] - lesion.speed_mps) < 25.0
    assert (speed[0] == 1500.0).all()


def test_water_needs_a_speed():
    with pytest.raises(InvalidInput, match="coupling_mps"):
        DetailedBreast(0.0)

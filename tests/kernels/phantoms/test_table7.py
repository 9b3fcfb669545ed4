"""The phantom of Table 7: its values, its nesting, its lesions, and that it changes along z."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE7_GRIDS, TABLE7_SIDE_M, table7, table7_slices

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

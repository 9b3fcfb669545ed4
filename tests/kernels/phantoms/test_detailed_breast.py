"""The detailed breast: the same object on any grid, with skin, fine detail and its stated speeds."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import DENSITIES, DETAILED_SIDE_M, LARGE_LESIONS, DetailedBreast

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

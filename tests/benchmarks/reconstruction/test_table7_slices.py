"""Slices of the 3-D breast phantom: thickness of the skin, errors on the phantom's nodes, lesions."""

import numpy as np
import pytest
from benchmarks.reconstruction._table7_errors import Slices, contrasts, least_contrast, on_phantom_nodes
from benchmarks.reconstruction._table7_slices import NODES, varied

from bentray_kernels.phantoms import TABLE7_SIDE_M, table7
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_service.cli.output.benchmark_row import BEST_CONSTANT, WATER_ALONE

WATER_MPS = 1500.0
CENTRE = table7(WATER_MPS).at(0.0)


def thickness(skin):
    """Thickness of the skin along the x axis, m."""
    x = np.arange(0.05, 0.09, 2e-5)
    return 2e-5 * (varied(WATER_MPS, skin).at(0.0).speed_at(x, 0.0) == 1650.0).sum()


@pytest.mark.parametrize(
    ("skin", "millimetres"), [("skin", 2.5), ("thin skin", 200.0 / 127.0), ("no skin", 0.0)]
)
def test_skin_is_as_thick_as_stated_and_nothing_else_changes(skin, millimetres):
    # The slice lies below the tip, where the dome is steep.
    assert thickness(skin) == pytest.approx(1e-3 * millimetres, rel=0.15)
    inner = np.linspace(-0.06, 0.06, 200)
    phantom = varied(WATER_MPS, skin).at(0.0)
    np.testing.assert_array_equal(phantom.speed_at(inner, 0.0), CENTRE.speed_at(inner, 0.0))


def made(speed, side_m=TABLE7_SIDE_M):
    spacing, origin = side_m / (len(speed) - 1), -0.5 * side_m
    return Reconstruction(
        speed, np.ones_like(speed), (spacing, spacing), (origin, origin), WATER_MPS, Settings()
    )


def test_images_are_averaged_over_the_cells_of_the_phantom():
    fine = CENTRE.speed(5 * NODES, TABLE7_SIDE_M)
    true = CENTRE.speed(NODES, TABLE7_SIDE_M)
    assert np.abs(on_phantom_nodes(made(fine), WATER_MPS) - true).mean() < 1.0
    small = on_phantom_nodes(made(np.full((64, 64), 1400.0), 0.5 * TABLE7_SIDE_M), WATER_MPS)
    assert small[NODES // 2, NODES // 2] == pytest.approx(1400.0)
    assert small[0, 0] == WATER_MPS


@pytest.mark.parametrize("whole", [True, False])
def test_errors_of_slices_are_rms_over_the_range(whole):
    phantoms = CENTRE, table7(WATER_MPS).at(0.02)
    slices = Slices(phantoms, whole)
    truths = [phantom.speed(NODES, TABLE7_SIDE_M) for phantom in phantoms]
    assert slices.error(truths) == 0.0
    assert slices.error([truth + 27.5 for truth in truths]) == pytest.approx(0.1)
    beside = slices.constants()
    assert 0.0 < beside[BEST_CONSTANT] <= beside[WATER_ALONE]
    assert (beside[WATER_ALONE] < 0.25) is whole


def test_lesions_of_the_truth_have_all_their_contrast():
    true = CENTRE.speed(NODES, TABLE7_SIDE_M)
    contrast = contrasts(CENTRE, true)
    assert sum(name.startswith("2 voxels") for name in contrast) == 2
    np.testing.assert_allclose(list(contrast.values()), 1.0)
    half = contrasts(CENTRE, 0.5 * (true + 1475.0))
    assert least_contrast(half, 2) == pytest.approx(0.5)
    assert np.isnan(least_contrast(contrast, 7))

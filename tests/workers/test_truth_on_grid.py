"""The truth on the nodes of an image: interpolation, axes, and the outline of the object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Truth
from bentray_workers.truth_on_grid import object_in, truth_on_grid

from .reconstructions import SPACING_M, WATER_MPS, made, truth


def test_on_the_same_grid_the_truth_is_itself():
    found = truth_on_grid(truth(), made(), 0)
    np.testing.assert_allclose(found, truth().sound_speed_mps)


def test_a_ramp_is_read_between_its_nodes_and_missing_beyond_them():
    x, y = np.meshgrid(np.linspace(-0.01, 0.01, 7), np.linspace(-0.02, 0.02, 9), indexing="ij")
    ramp = Truth(1500.0 + 1e3 * x - 2e3 * y, (0.02 / 6, 0.005), (-0.01, -0.02))
    result = made()
    place = result.origin_m[0] + SPACING_M * np.arange(24)
    expected = 1500.0 + 1e3 * place[:, None] - 2e3 * place[None, :]
    inside = (np.abs(place) <= 0.01)[:, None] & (np.abs(place) <= 0.02)[None, :]
    found = truth_on_grid(ramp, result, 0)
    np.testing.assert_allclose(found[inside], expected[inside])
    assert np.isnan(found[~inside]).all()


def test_axes_are_brought_to_x_and_y():
    plain = truth()
    turned = replace(plain, sound_speed_mps=plain.sound_speed_mps.T.copy(), axes="y,x")
    np.testing.assert_array_equal(truth_on_grid(turned, made(), 0), truth_on_grid(plain, made(), 0))
    assert not np.array_equal(turned.sound_speed_mps, plain.sound_speed_mps)


def test_a_volume_is_cut_at_the_slice():
    volume = Truth(
        np.full((3, 3, 3), 1500.0) + 10.0 * np.arange(3), (0.1, 0.1, 0.01), (-0.1, -0.1, 0.0), axes="x,y,z"
    )
    result = replace(made(slices=2), spacing_m=(SPACING_M, SPACING_M, 0.01), origin_m=(-0.02, -0.02, 0.005))
    np.testing.assert_allclose(truth_on_grid(volume, result, 1), 1515.0)


@pytest.mark.parametrize("other", [None, truth(axes="as displayed; needs registration"), truth(axes="x,y,z")])
def test_what_cannot_be_laid_on_the_image_is_none(other):
    assert truth_on_grid(other, made(), 0) is None
    assert truth_on_grid(truth(), made(slices=2), 0) is None


def test_the_object_is_what_is_not_water_and_what_it_encloses():
    speed = np.full((9, 9), WATER_MPS)
    speed[2:7, 2:7] = 1450.0
    speed[4, 4] = WATER_MPS
    speed[0, 0] = np.nan
    region = object_in(speed, WATER_MPS)
    assert region.sum() == 25
    assert region[4, 4]
    everywhere = object_in(np.full((3, 3), WATER_MPS), WATER_MPS)
    assert everywhere.all()

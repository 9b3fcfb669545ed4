"""The truth on the nodes of an image: interpolation, axes, and what cannot be laid on it."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Reconstruction
from bentray_kernels.tomography.comparison import NotComparable, on_grid

from .squares import STEP, WATER, disc, image
from .squares import truth as of_speed

SPACING_M = 2e-3


def truth(axes: str = "x,y") -> Truth:
    return replace(of_speed(disc()), axes=axes)


def made(slices: int | None = None) -> Reconstruction:
    """An image of the nodes of the truth; slices are at uneven heights."""
    if slices is None:
        return image(disc())
    solid = image(np.full((24, 24, slices), WATER), (0.0,) * 3)
    return replace(solid, spacing_m=(STEP, STEP, np.nan))


def speed_on_grid(truth: Truth, result: Reconstruction) -> np.ndarray:
    return on_grid(truth.sound_speed_mps, truth, result)


def test_on_the_same_grid_the_truth_is_itself():
    np.testing.assert_allclose(speed_on_grid(truth(), made()), truth().sound_speed_mps)


def test_a_ramp_is_read_between_its_nodes_and_missing_beyond_them():
    x, y = np.meshgrid(np.linspace(-0.01, 0.01, 7), np.linspace(-0.02, 0.02, 9), indexing="ij")
    ramp = Truth(1500.0 + 1e3 * x - 2e3 * y, (0.02 / 6, 0.005), (-0.01, -0.02))
    result = replace(image(np.full((24, 24), WATER), (-0.023, -0.023)), spacing_m=(SPACING_M, SPACING_M))
    position = result.origin_m[0] + SPACING_M * np.arange(24)
    expected = 1500.0 + 1e3 * position[:, None] - 2e3 * position[None, :]
    inside = (np.abs(position) <= 0.01)[:, None] & (np.abs(position) <= 0.02)[None, :]
    computed = speed_on_grid(ramp, result)
    np.testing.assert_allclose(computed[inside], expected[inside])
    assert np.isnan(computed[~inside]).all()


def test_axes_are_brought_to_x_and_y():
    plain = truth()
    turned = replace(plain, sound_speed_mps=plain.sound_speed_mps.T.copy(), axes="y,x")
    np.testing.assert_array_equal(speed_on_grid(turned, made()), speed_on_grid(plain, made()))
    assert not np.array_equal(turned.sound_speed_mps, plain.sound_speed_mps)


def test_a_volume_is_read_at_each_slice():
    volume = Truth(
        np.full((3, 3, 3), 1500.0) + 10.0 * np.arange(3), (0.1, 0.1, 0.01), (-0.1, -0.1, 0.0), axes="x,y,z"
    )
    result = replace(made(slices=2), spacing_m=(SPACING_M, SPACING_M, 0.01), origin_m=(-0.02, -0.02, 0.005))
    results = speed_on_grid(volume, result)
    assert results.shape == result.speed.shape
    np.testing.assert_allclose(results[..., 0], 1505.0)
    np.testing.assert_allclose(results[..., 1], 1515.0)


def solid() -> Truth:
    return Truth(np.full((3, 3, 3), 1500.0), (0.1,) * 3, (0.0,) * 3, axes="x,y,z")


@pytest.mark.parametrize(
    ("known", "result", "why"),
    [
        (truth(axes="as displayed"), made(), "registered"),
        (truth(axes="x,y,z"), made(), "axes x,y,z and 2 dimensions, the image 2"),
        (truth(), made(slices=2), "the image 3"),
        (solid(), made(slices=2), "not evenly spaced"),
    ],
)
def test_rejects_truths_on_incompatible_grids(known, result, why):
    with pytest.raises(NotComparable, match=why):
        speed_on_grid(known, result)

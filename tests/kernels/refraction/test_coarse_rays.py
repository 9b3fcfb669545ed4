"""Previews from fewer rays than pixels: interpolated within a piece of the picture, and only there."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.refraction import (
    Picture,
    RenderSettings,
    Scene,
    render,
)

from .solids import BACKDROP, CAMERA, RADIUS, glass_ball


@pytest.fixture(scope="module")
def scene() -> Scene:
    return glass_ball()


def picture(scene: Scene, **options) -> Picture:
    given = {"rows": 60, "columns": 61, "supersampling": "none"} | options
    return render(scene, CAMERA, BACKDROP, RenderSettings(**given))


@pytest.mark.parametrize("spacing", [2, 3])
def test_rays_between_others_end_between_them(scene, spacing):
    full, coarse = picture(scene), picture(scene, ray_spacing=spacing)
    assert coarse.image.shape == full.image.shape == (60, 61, 3)
    u, v = np.meshgrid((np.arange(61) + 0.5) / 61 - 0.5, (np.arange(60) + 0.5) / 60 - 0.5)
    radius = np.hypot(u, v)
    beside, inside = radius > RADIUS + 0.1, radius < 0.6 * RADIUS
    # Beside the ball rays are straight, and interpolation is exact but for the pixels before the first ray.
    middle = (np.abs(u) < 0.46) & (np.abs(v) < 0.46)
    np.testing.assert_allclose(
        coarse.position_m[beside & middle], full.position_m[beside & middle], atol=1e-9
    )
    assert np.abs(coarse.position_m - full.position_m)[inside].max() < 0.02
    np.testing.assert_array_equal(coarse.crossed[inside], 2)


def test_the_outline_is_that_of_the_nearest_ray(scene):
    coarse, few = picture(scene, columns=60, ray_spacing=2), picture(scene, rows=30, columns=30)
    np.testing.assert_array_equal(coarse.crossed, few.crossed.repeat(2, 0).repeat(2, 1))
    # No place lies between one that the ball bent and one beside it, where rays are straight.
    straight = np.stack(np.meshgrid(*[(np.arange(60) + 0.5) / 60 - 0.5] * 2), axis=-1)
    beside = coarse.crossed == 0
    np.testing.assert_allclose(coarse.position_m[beside], straight[beside], atol=1.0 / 60)


def test_each_piece_keeps_its_own_light(scene):
    coarse = picture(scene, ray_spacing=2, fresnel=True)
    assert (coarse.weight[coarse.crossed == 0] == 1.0).all()
    assert (coarse.weight[coarse.crossed == 2] < 0.97).all()


def test_one_pixel_a_ray_is_the_whole_picture(scene):
    for name in ("image", "position_m", "plane", "fate", "crossed", "weight"):
        np.testing.assert_array_equal(
            getattr(picture(scene), name), getattr(picture(scene, ray_spacing=1), name)
        )


@pytest.mark.parametrize(
    ("options", "accepted"),
    [
        ({"ray_spacing": 0}, ">= 1"),
        ({"ray_spacing": 2, "supersampling": "real"}, "1 with real supersampling"),
    ],
)
def test_rejects_invalid_spacing(options, accepted):
    with pytest.raises(InvalidInput, match="ray_spacing") as caught:
        RenderSettings(**options)
    assert accepted in str(caught.value)

"""Refraction pictures: cameras, maps in metres, supersampling, previews, threads, rejected settings."""

from dataclasses import astuple

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.refraction import (
    Camera,
    Picture,
    RenderSettings,
    Scene,
    backdrop_of,
    checkerboard,
    orthographic,
    perspective,
    render,
)
from bentray_kernels.refraction.caster import LOST, REFRACTED

from .solids import BACKDROP, CAMERA, RADIUS, glass_ball, through_ball


@pytest.fixture(scope="module")
def scene() -> Scene:
    return glass_ball()


def picture(scene: Scene, **options) -> Picture:
    return render(scene, CAMERA, BACKDROP, RenderSettings(**({"rows": 48, "columns": 48} | options)))


def test_the_map_of_positions_is_in_metres(scene):
    made = picture(scene, rows=24, columns=32)
    x, y = (np.arange(32) + 0.5) / 32 - 0.5, (np.arange(24) + 0.5) / 24 - 0.5
    u, v = np.meshgrid(x, y)
    radius = np.hypot(u, v)
    outside = radius > RADIUS
    np.testing.assert_allclose(made.position_m[outside], np.stack([u, v], -1)[outside], atol=1e-12)
    inside = radius < 0.98 * RADIUS
    exact = through_ball(radius[inside], RADIUS, 1.5, 1.0)[0] / radius[inside]
    np.testing.assert_allclose(
        made.position_m[inside], (np.stack([u, v], -1))[inside] * exact[:, None], atol=1e-6
    )
    assert ((made.fate == REFRACTED) == ~outside).all()
    np.testing.assert_array_equal(made.crossed[inside], 2)
    assert made.image.shape == (24, 32, 3)
    assert made.image.dtype == np.uint8


def test_supersampling_comes_nearer_to_the_picture_of_64_samples(scene):
    truth = picture(scene, supersampling="real", degree=8, seed=1).image.astype(float)

    def psnr(**options) -> float:
        error = picture(scene, **options).image - truth
        return float(10.0 * np.log10(255.0**2 / (error**2).mean()))

    none, post = psnr(supersampling="none"), psnr(supersampling="prss")
    assert post > none + 3.0
    assert psnr(supersampling="prss", degree=3) > post
    assert psnr(supersampling="real", degree=3) > post


@pytest.mark.parametrize("options", [{"threads": 2}, {"ray_spacing": 1}], ids=str)
def test_result_does_not_depend_on_threads_and_tiles_nor_on_one_pixel_a_ray(scene, options):
    for ours, theirs in zip(astuple(picture(scene)), astuple(picture(scene, **options)), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_jitter_is_drawn_from_its_seed(scene):
    options = {"supersampling": "real", "degree": 2}
    same = [picture(scene, **options, seed=4).image for _ in range(2)]
    np.testing.assert_array_equal(*same)
    assert (picture(scene, **options, seed=5).image != same[0]).any()
    even = picture(scene, **options, seed=None)
    assert even.position_m.shape == (96, 96, 2)
    np.testing.assert_allclose(even.position_m[0, :, 0], (np.arange(96) + 0.5) / 96 - 0.5, atol=1e-12)


def test_fresnels_weights_darken_the_rim(scene):
    bright, dim = picture(scene, supersampling="none"), picture(scene, supersampling="none", fresnel=True)
    np.testing.assert_array_equal(dim.image[0, 0], bright.image[0, 0])
    middle = dim.image[24, 24].astype(float) / bright.image[24, 24]
    np.testing.assert_allclose(middle, 0.96**2, atol=0.01)
    assert dim.weight.min() < 0.7


def test_lost_rays_show_what_lies_beyond_the_backdrop(scene):
    beyond = (90, 60, 30)
    board = backdrop_of([checkerboard((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 10)], beyond)
    made = render(scene, CAMERA, board, RenderSettings(rows=48, columns=48, depth=1))
    lost = made.fate == LOST
    assert lost.sum() > 500
    assert (made.plane[lost] == -1).all()
    assert np.isnan(made.position_m[lost]).all()
    inner = lost & np.roll(lost, 1, 0) & np.roll(lost, -1, 0)
    assert inner.sum() > 400
    assert (made.image[inner] == beyond).all()


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ({"rows": 0}, "rows"),
        ({"columns": -1}, "columns"),
        ({"depth": 0}, "depth"),
        ({"degree": 0}, "degree"),
        ({"threads": 0}, "threads"),
        ({"supersampling": "adaptive"}, "supersampling"),
    ],
)
def test_settings_that_cannot_be_are_rejected(wrong, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        RenderSettings(**wrong)


def preview(scene: Scene, **options) -> Picture:
    return picture(scene, **({"rows": 60, "columns": 61, "supersampling": "none"} | options))


@pytest.mark.parametrize("spacing", [2, 3])
def test_rays_between_others_end_between_them(scene, spacing):
    full, coarse = preview(scene), preview(scene, ray_spacing=spacing)
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
    coarse, few = preview(scene, columns=60, ray_spacing=2), preview(scene, rows=30, columns=30)
    np.testing.assert_array_equal(coarse.crossed, few.crossed.repeat(2, 0).repeat(2, 1))
    # No place lies between one that the ball bent and one beside it, where rays are straight.
    straight = np.stack(np.meshgrid(*[(np.arange(60) + 0.5) / 60 - 0.5] * 2), axis=-1)
    beside = coarse.crossed == 0
    np.testing.assert_allclose(coarse.position_m[beside], straight[beside], atol=1.0 / 60)


def test_each_piece_keeps_its_own_light(scene):
    coarse = preview(scene, ray_spacing=2, fresnel=True)
    assert (coarse.weight[coarse.crossed == 0] == 1.0).all()
    assert (coarse.weight[coarse.crossed == 2] < 0.97).all()


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


def ray(camera: Camera, u: float, v: float) -> tuple[np.ndarray, np.ndarray]:
    position = np.array([1.0, u, v])
    direction = position @ camera.direction
    return position @ camera.origin, direction / np.linalg.norm(direction)


def test_parallel_rays_start_on_the_rectangle():
    camera = orthographic((0.0, -2.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 1.0), 0.4, 0.5)
    start, ahead = ray(camera, 0.5, -0.5)
    np.testing.assert_allclose(start, [0.2, -2.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(ahead, [0.0, 1.0, 0.0], atol=1e-12)


def test_rays_from_the_eye_span_the_angle():
    camera = perspective((0.0, -2.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 60.0)
    left, right = ray(camera, -0.5, 0.0), ray(camera, 0.5, 0.0)
    np.testing.assert_allclose(left[0], [0.0, -2.0, 0.0])
    assert np.degrees(np.arccos(left[1] @ right[1])) == pytest.approx(60.0)
    assert right[1][0] > 0.0
    assert ray(camera, 0.0, -0.5)[1][2] > 0.0
    np.testing.assert_allclose(ray(camera, 0.0, 0.0)[1], [0.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: orthographic((0, 0, 0), (0, 0, 1), (0, 0, 2), 1.0), "up"),
        (lambda: orthographic((0, 0, 0), (0, 0, 1), (0, 1, 0), 0.0), "width_m"),
        (lambda: orthographic((0, 0, 0), (0, 0, 1), (0, 1, 0), 1.0, float("nan")), "aspect"),
        (lambda: perspective((0, 0, 0), (0, 0, 1), (0, 1, 0), 180.0), "view_deg"),
        (lambda: perspective((0, 0, 0), (0, 0, 0), (0, 1, 0), 30.0), "up"),
    ],
)
def test_rejects_invalid_cameras(make, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        make()

"""The shaded surface: distances and normals of a ball, and Lambert's and Phong's shares."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.refraction import Light, orthographic, shade

from .solids import CAMERA, RADIUS, glass_ball


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_ball_is_seen_where_it_is(sign):
    shaded = shade(
        glass_ball(24, sign), CAMERA, Light((0.0, 0.0, -1.0), 0.0, 1.0, 0.0, colour=(200, 100, 50)), 41, 41
    )
    position = (np.arange(41) + 0.5) / 41 - 0.5
    radius = np.hypot(position[:, None], position)
    seen = radius < RADIUS
    np.testing.assert_array_equal(np.isfinite(shaded.distance_m), seen)
    depth = np.sqrt(np.maximum(RADIUS**2 - radius**2, 0.0))
    np.testing.assert_allclose(shaded.distance_m[seen], (2.0 - depth)[seen], atol=1e-8)
    cosine = (depth / RADIUS)[seen]
    np.testing.assert_allclose(-sign * shaded.normal[seen][:, 2], cosine, atol=1e-6)
    np.testing.assert_allclose(shaded.image[seen], cosine[:, None] * [200, 100, 50], atol=0.51)
    assert (shaded.image[~seen] == 0).all()


def test_the_highlight_lies_where_the_light_is_mirrored():
    towards = (np.sin(0.8), 0.0, -np.cos(0.8))
    light = Light(towards, 0.0, 0.0, 1.0, 200.0, background=(1, 2, 3))
    shaded = shade(glass_ball(24, 1.0), CAMERA, light, 81, 81)
    row, column = np.unravel_index(shaded.image[..., 0].argmax(), (81, 81))
    assert row == 40
    # Half way between the camera and the light.
    assert (column + 0.5) / 81 - 0.5 == pytest.approx(RADIUS * np.sin(0.4), abs=1.0 / 81)
    assert shaded.image[0, 0].tolist() == [1, 2, 3]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_oblique_view_is_shaded_by_phongs_model(sign):
    """The reflection of the light about the normal, seen along a direction with three components."""
    ahead, towards = np.array([0.5, -0.3, 0.6]), np.array([-0.2, 0.7, -0.6])
    ahead, towards = ahead / np.linalg.norm(ahead), towards / np.linalg.norm(towards)
    light = Light(tuple(towards), 0.1, 0.4, 0.45, 3.0, colour=(200, 100, 50))
    camera = orthographic(tuple(-2.0 * ahead), tuple(ahead), (0.0, -1.0, 0.0), 0.9)
    shaded = shade(glass_ball(24, sign), camera, light, 31, 31)
    seen = np.isfinite(shaded.distance_m)
    normal = shaded.normal[seen]
    normal *= -np.sign(normal @ ahead)[:, None]
    cosine = np.maximum(normal @ towards, 0.0)
    mirrored = 2.0 * (normal @ towards)[:, None] * normal - towards
    highlight = np.where(cosine > 0.0, np.maximum(-mirrored @ ahead, 0.0) ** 3.0, 0.0)
    colour = (0.1 + 0.4 * cosine)[:, None] * [200, 100, 50] + 255.0 * 0.45 * highlight[:, None]
    np.testing.assert_allclose(shaded.image[seen], np.minimum(colour, 255.0), atol=0.51)
    assert highlight.max() > 0.9


def test_no_pixels_are_rejected():
    with pytest.raises(InvalidInput, match="rows, columns"):
        shade(glass_ball(24, 1.0), CAMERA, Light((0.0, 0.0, -1.0)), 0, 4)


def test_threads_shade_the_same_picture_and_are_paused():
    light = Light((0.0, 0.6, -0.8))
    whole = shade(glass_ball(24, 1.0), CAMERA, light, 41, 37)
    pauses = []
    threaded = shade(glass_ball(24, 1.0), CAMERA, light, 41, 37, threads=3, pause=lambda: pauses.append(1))
    np.testing.assert_array_equal(threaded.image, whole.image)
    np.testing.assert_array_equal(threaded.normal, whole.normal)
    np.testing.assert_array_equal(threaded.distance_m, whole.distance_m)
    assert len(pauses) == 3

"""Refraction and reflection at a surface: Snell, Fresnel, and the shares of Lambert and Phong."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.arrays import Vector
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.refraction import Light, orthographic, shade
from bentray_kernels.refraction.optics import reflectances, refracted

from ...effort import effort
from .solids import CAMERA, RADIUS, glass_ball


@kernel
def bend(direction: Vector, normal: Vector, ratio: float) -> tuple[Vector, float, bool]:
    return refracted(direction, normal, ratio)


@kernel
def mirrored_shares(cosine: float, behind: float, ratio: float) -> tuple[float, float]:
    return reflectances(cosine, behind, ratio)


def unit(seed: int) -> np.ndarray:
    vector = np.random.default_rng(seed).normal(size=3)
    return vector / np.linalg.norm(vector)


@given(seeds=st.tuples(st.integers(0, 10**6), st.integers(0, 10**6)), ratio=st.floats(0.3, 3.0))
@settings(deadline=None, max_examples=effort(20, 300))
def test_snells_law_in_the_plane_of_incidence(seeds, ratio):
    direction, normal = unit(seeds[0]), unit(seeds[1])
    bent, share, passed = bend(tuple(direction), tuple(normal), ratio)
    bent = np.array(bent)
    sine = np.linalg.norm(np.cross(direction, normal))
    assert np.linalg.norm(bent) == pytest.approx(1.0, abs=1e-12)
    # In one plane, and the component along the surface scaled by the ratio.
    np.testing.assert_allclose(
        np.cross(bent, normal), (ratio if passed else 1.0) * np.cross(direction, normal), atol=1e-9
    )
    assert passed == (ratio * sine <= 1.0)
    assert np.sign(bent @ normal) == np.sign(direction @ normal) * (1 if passed else -1)
    assert 0.0 <= share <= 1.0
    if not passed:
        assert share == 1.0
        np.testing.assert_allclose(bent, direction - 2.0 * (direction @ normal) * normal, atol=1e-12)


@given(seed=st.integers(0, 10**6), ratio=st.floats(0.3, 3.0))
def test_paths_are_reversible(seed, ratio):
    direction, normal = unit(seed), unit(seed + 1)
    bent, share, passed = bend(tuple(direction), tuple(normal), ratio)
    if passed and abs(np.array(bent) @ normal) > 1e-3:
        back, share_back, _ = bend(tuple(-np.array(bent)), tuple(normal), 1.0 / ratio)
        np.testing.assert_allclose(back, -direction, atol=1e-9)
        assert share_back == pytest.approx(share, abs=1e-9)


@pytest.mark.parametrize("ratio", [1.1, 1.33, 1.5, 2.4])
def test_total_reflection_begins_at_the_critical_angle(ratio):
    for offset, passes in ((-1e-6, True), (1e-6, False)):
        angle = np.arcsin(1.0 / ratio) + offset
        _, _, passed = bend((np.sin(angle), 0.0, np.cos(angle)), (0.0, 0.0, 1.0), ratio)
        assert passed == passes


def test_fresnels_shares_at_known_angles():
    # Glass at right angles: ((1.5 − 1)/(1.5 + 1))²; at Brewster's angle nothing is mirrored in the plane.
    assert mirrored_shares(1.0, 1.0, 1.0 / 1.5) == pytest.approx((0.04, 0.04))
    brewster = np.arctan(1.5)
    s, p = mirrored_shares(np.cos(brewster), np.sin(brewster), 1.0 / 1.5)
    assert p == pytest.approx(0.0, abs=1e-15)
    assert s == pytest.approx(((1.5**2 - 1.0) / (1.5**2 + 1.0)) ** 2)


def test_equal_indices_do_not_refract():
    direction = tuple(unit(7))
    bent, share, passed = bend(direction, tuple(unit(8)), 1.0)
    np.testing.assert_allclose(bent, direction, atol=1e-15)
    assert share == pytest.approx(1.0)
    assert passed


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

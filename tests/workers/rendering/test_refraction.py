"""Pictures through volumes: straight where nothing refracts, the same in tiles and on a cluster."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.phantoms import ONE_HOLE, FringeSphere, sampled
from bentray_kernels.refraction import RenderSettings
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.images.backdrop_card import backdrop_card
from bentray_workers.rendering import refraction
from bentray_workers.rendering.refraction import draw_tile, frame_of, picture_png, tile_image
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.rendering.scene_cache import scene_at
from bentray_workers.rendering.tiles import TASK_RAYS, stack_png, tile_rows

from ..pixels import pixels_of

NOISY = {"smooth_edges": False}
SMALL = RefractionView(iso=(0.5,), width=48, height=32)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("ball") / "v.h5"
    write_volume(path, Volume.from_values(sampled(ONE_HOLE, 24), (1e-3,) * 3))
    return path


def whole(path, view, card=None):
    return draw_tile(scene_at(path, view), view, 0, view.height, card)


@pytest.mark.parametrize("camera", ["orthographic", "perspective"])
@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (200, -35), (10, 90), (10, -90)])
def test_without_refraction_the_backdrop_is_seen_straight(path, camera, azimuth, elevation):
    view = replace(SMALL, index=(1.0,), camera=camera, azimuth_deg=azimuth, elevation_deg=elevation)
    result = whole(path, replace(view, supersampling="none")).position_m
    # The shorter side shows 1.25 times the longest side of the volume; a perspective shows more farther away.
    side = 1.25 * 0.023
    if camera == "perspective":
        side *= 1.0 + view.backdrop_distance / refraction.EYE_DISTANCE
    pixel = side / 32
    np.testing.assert_allclose(result[..., 0], np.tile((np.arange(48) - 23.5) * pixel, (32, 1)), atol=1e-9)
    np.testing.assert_allclose(result[..., 1], np.tile((np.arange(32) - 15.5) * pixel, (48, 1)).T, atol=1e-9)


@pytest.mark.parametrize("kind", ["checkerboard", "picture"])
def test_a_warped_backdrop_is_met_at_its_heights(path, kind):
    view = replace(SMALL, index=(1.0,), supersampling="none", backdrop=kind)
    warped = replace(view, backdrop=f"warped-{kind}")
    # Parallel rays meet the surface above the same place of the rectangle.
    np.testing.assert_allclose(whole(path, warped).position_m, whole(path, view).position_m, atol=1e-9)
    flat, result = (whole(path, replace(one, camera="perspective")).position_m for one in (view, warped))
    # Rays of an eye meet it where both are as far behind the eye.
    away = (refraction.EYE_DISTANCE + view.backdrop_distance) * 0.023 * np.sqrt(3.0)
    rise = away * (result / flat - 1.0).mean(axis=2)
    side = 1.25 * 0.023 * (1.0 + view.backdrop_distance / refraction.EYE_DISTANCE)
    wide = side * (backdrop_card().shape[1] / backdrop_card().shape[0] if kind == "picture" else 1.0)
    u, v = result[..., 0] / wide, result[..., 1] / side
    height = 0.1 * side * (1.0 - np.cos(4.0 * np.pi * u) * np.cos(4.0 * np.pi * v))
    np.testing.assert_allclose(rise, height, atol=2e-3 * side)
    assert np.ptp(rise) > 0.15 * side
    bent = replace(warped, index=(1.5,), supersampling="prss")
    assert (whole(path, bent).image != whole(path, replace(bent, backdrop=kind)).image).any()


def test_a_ball_of_glass_bends_as_snell_says(tmp_path):
    """Rays parallel to its axis, 0.5 of its radius and less from it: in closed form."""
    ball, index, edge = FringeSphere(0.4, 0.3), 1.5, 0.5 * 0.031
    write_volume(tmp_path / "v.h5", Volume.from_values(sampled(ball, 32), (1e-3,) * 3))
    view = replace(SMALL, height=48, index=(index,), supersampling="none", backdrop_distance=0.7)
    computed = whole(tmp_path / "v.h5", view).position_m[23, :, 0]
    radius, screen = ball.iso_radius(0.5) * edge, 0.7 * 2.0 * edge * np.sqrt(3.0)
    offset = (np.arange(48) - 23.5) / 48 * 1.25 * 2.0 * edge
    # The row lies half a pixel beside the axis.
    apart = np.hypot(offset, offset[24])
    near = apart < 0.5 * radius
    incidence, within = np.arcsin(apart[near] / radius), np.arcsin(apart[near] / radius / index)
    leaves = incidence + np.pi - 2.0 * within
    behind = screen + radius * np.cos(leaves)
    expected = radius * np.sin(leaves) - behind * np.tan(2.0 * (incidence - within))
    np.testing.assert_allclose(computed[near], expected * offset[near] / apart[near], atol=0.005 * edge)
    assert near.sum() > 8
    assert np.sign(computed[near]).tolist() == (-np.sign(offset[near])).tolist()


def test_rays_that_meet_more_surfaces_than_allowed_show_dark_grey(path):
    """The description of ``depth`` says so."""
    image = whole(path, replace(SMALL, depth=1)).image
    assert (image[14:18, 22:26] == refraction.BEYOND).all()
    assert (whole(path, SMALL).image[14:18, 22:26] != refraction.BEYOND).any()


def test_the_frame_is_right_handed_with_z_up():
    ahead, right, down = frame_of(RefractionView(azimuth_deg=0.0, elevation_deg=0.0, up="z"))
    np.testing.assert_allclose(ahead, [-1.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(right, [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(down, [0.0, 0.0, -1.0], atol=1e-15)


@pytest.mark.parametrize(
    "how",
    [
        {"supersampling": "none"},
        {"supersampling": "prss"},
        {"supersampling": "prss", "degree": 3, "backdrop": "picture", "camera": "perspective"},
        {"mode": "shaded"},
    ],
    ids=str,
)
def test_tiles_equal_the_whole_picture(path, how):
    view = replace(SMALL, **how)
    image = whole(path, view).image
    parts = [tile_image(path, view, first, min(first + 7, 32)) for first in range(0, 32, 7)]
    joined = pixels_of(stack_png(parts))
    assert joined.shape == (32, 48, 3)
    # The same rays but for the last digit, which may move a pixel over the border of a square.
    assert (joined != image).any(axis=-1).mean() < 0.005
    np.testing.assert_array_equal(pixels_of(picture_png(path, view)), image)


def test_real_supersampling_smooths(path):
    view = replace(SMALL, supersampling="real", degree=4)
    levels = len(np.unique(whole(path, view).image))
    assert levels > 8 > len(np.unique(whole(path, replace(view, supersampling="none")).image))
    lit = replace(view, mode="shaded")
    edges = len(np.unique(whole(path, lit).image.reshape(-1, 3), axis=0))
    assert edges > len(
        np.unique(whole(path, replace(lit, supersampling="none")).image.reshape(-1, 3), axis=0)
    )


def test_edges_of_glass_are_smoothed(path, monkeypatch):
    view = replace(SMALL, width=96, height=64)
    smooth, flat = (whole(path, replace(view, index=(n,))).image.astype(int) for n in (1.5, 1.0))
    monkeypatch.setattr(refraction, "RenderSettings", lambda **how: RenderSettings(**how | NOISY))
    noisy, fine = (
        whole(path, replace(view, supersampling=name, degree=n)).image.astype(int)
        for name, n in (("prss", 1), ("real", 8))
    )
    before, after = (np.sqrt(np.mean((image - fine) ** 2)) for image in (noisy, smooth))
    assert after < 0.8 * before
    # Where all rays take the same path nothing is smoothed.
    np.testing.assert_array_equal(whole(path, replace(view, index=(1.0,))).image[:8], flat[:8])


def test_a_picture_of_ones_own(path):
    card = np.zeros((4, 8, 3), dtype=np.uint8)
    card[:, :4] = (200, 0, 0)
    view = replace(SMALL, index=(1.0,), backdrop="picture", supersampling="none")
    image = whole(path, view, card).image
    assert image[16, 12].tolist() == [200, 0, 0]
    assert image[16, 36].tolist() == [0, 0, 0]
    assert (whole(path, view).image[:, :, 2] > 0).mean() > 0.5


@pytest.mark.parametrize(
    ("view", "rows"),
    [
        (RefractionView(), [512]),
        (RefractionView(width=4096, height=4096), [128] * 32),
        (RefractionView(width=1000, height=1000, supersampling="real", degree=4), [32] * 31 + [8]),
        (RefractionView(width=4096, height=10, supersampling="real", degree=8), [2] * 5),
    ],
)
def test_a_task_has_about_a_second_of_work(view, rows):
    assert [last - first for first, last in tile_rows(view)] == rows
    assert tile_rows(view)[-1][1] == view.height


SIDES = st.integers(1, 4096)


@given(SIDES, SIDES, st.integers(1, 8))
def test_every_row_is_in_exactly_one_tile(width, height, times):
    parts = tile_rows(SimpleNamespace(width=width, height=height, times=times))
    assert [row for first, last in parts for row in range(first, last)] == list(range(height))
    rays = [(last - first) * width * times**2 for first, last in parts]
    assert all(
        count <= TASK_RAYS or last - first == 1 for count, (first, last) in zip(rays, parts, strict=True)
    )
    # No strip could take the rows of the next one too.
    assert all(one + other > TASK_RAYS for one, other in pairwise(rays[:-1]))

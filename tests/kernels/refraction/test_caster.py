"""Rays through whole objects: a ball's exact refraction, the way back, layers, cut faces and limits."""

import numpy as np
import pytest

from bentray_kernels.refraction import Layers, Scene
from bentray_kernels.refraction.caster import (
    LOST,
    MISSED,
    REFRACTED,
    Traced,
    allocate_results,
    cast,
    medium_of,
)
from bentray_kernels.splines import Spline

from .solids import distance, squared, through_ball

RADIUS = 0.31


def scene(volume: np.ndarray, layers: Layers, **options) -> Scene:
    return Scene.build(Spline(volume, prefilter=False), layers, 1.0 / (len(volume) - 1), **options)


def ball(index: float = 1.5) -> Scene:
    """A ball of one index: the layer below the iso-value lies inside."""
    return scene(-squared(24), Layers((-(RADIUS**2),), (1.0, index)))


def trace(scene: Scene, starts, directions, depth=16, structure="octree", roots="certain") -> Traced:
    """Rays with any start and direction: each is its own camera."""
    starts, directions = np.atleast_2d(starts).astype(float), np.atleast_2d(directions).astype(float)
    directions = directions / np.linalg.norm(directions, axis=1)[:, None]
    traced = allocate_results(len(starts))
    medium, search = medium_of(scene, structure), scene.search(structure, roots, 0.05)
    for n, (start, ahead) in enumerate(zip(starts, directions, strict=True)):
        still = np.zeros((2, 3))
        camera = np.vstack([start, still]), np.vstack([ahead, still])
        cast(medium, search, camera, np.zeros((1, 2)), depth, traced.part(slice(n, n + 1)))
    return traced


def screen_error(scene: Scene, volume_radius: float, index: float, reach: float, **options) -> np.ndarray:
    """How far from the exact place rays meet a screen one cube behind, over the radius."""
    random = np.random.default_rng(2)
    offset = volume_radius * np.sqrt(random.random(400)) * reach
    angle = 2.0 * np.pi * random.random(400)
    across = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    starts = np.column_stack([offset[:, None] * across, np.full(400, -2.0)])
    traced = trace(scene, starts, np.tile([0.0, 0.0, 1.0], (400, 1)), **options)
    exact, _ = through_ball(offset, volume_radius, index, 1.0)
    assert (traced.crossed == 2).all()
    s = (1.0 - traced.point[:, 2]) / traced.direction[:, 2]
    result = traced.point[:, :2] + s[:, None] * traced.direction[:, :2]
    return np.linalg.norm(result - exact[:, None] * across, axis=1) / volume_radius


@pytest.mark.parametrize("structure", ["octree", "dda", "steps"])
def test_the_surroundings_may_be_any_layer(structure):
    """A ball of low values in surroundings of high ones, as fat in water, refracts as its negative does."""
    dark = scene(squared(24), Layers((RADIUS**2,), (1.5, 1.0), surroundings=1))
    assert not dark.open
    assert screen_error(dark, RADIUS, 1.5, 0.99, structure=structure).max() < 1e-7
    # A second surface, nearer to the faces, of a layer that does not refract; the corners lie beyond it.
    cut = scene(squared(24), Layers((RADIUS**2, 0.7), (1.5, 1.0, 1.0), surroundings=1))
    assert cut.open
    assert screen_error(cut, RADIUS, 1.5, 0.99, structure=structure).max() < 1e-7


def test_only_faces_of_another_layer_bend():
    """Rays past a ball go straight on where what lies beside it goes on around the grid."""
    past, ahead = [[0.45, 0.45, -2.0]], [[0.02, -0.01, 1.0]]
    for surroundings, crossed in ((1, 0), (0, 2)):
        dark = scene(squared(24), Layers((RADIUS**2,), (1.5, 1.0), surroundings))
        assert trace(dark, past, ahead).crossed[0] == crossed


@pytest.mark.parametrize("structure", ["octree", "dda", "steps"])
def test_a_ball_refracts_exactly_where_the_field_is_exact(structure):
    assert screen_error(ball(), RADIUS, 1.5, 0.99, structure=structure).max() < 1e-7


def test_a_ball_sampled_as_a_distance_refracts_to_one_in_a_hundred_thousand():
    volume = RADIUS - distance(144)
    made = Scene.build(Spline(volume), Layers((0.0,), (1.0, 1.5)), 1.0 / 143)
    assert screen_error(made, RADIUS, 1.5, 0.9).max() < 1e-5


def test_the_axes_may_have_different_spacings_and_the_middle_lie_anywhere():
    axis = np.linspace(-0.5, 0.5, 24)
    x, y, z = axis[:, None, None], 1.5 * axis[:17, None] + 0.2, 0.8 * axis
    # Coefficients of the exact squares, as in ``solids.squared``.
    steps = np.array([x[1, 0, 0] - x[0, 0, 0], y[1, 0] - y[0, 0], z[1] - z[0]])
    volume = RADIUS**2 - (x**2 + y**2 + z**2 - (steps**2).sum() / 3.0)
    middle = np.array([0.0, 0.5 * (y[0, 0] + y[-1, 0]), 0.0])
    spline = Spline(volume, prefilter=False)
    made = Scene.build(spline, Layers((0.0,), (1.0, 1.5)), steps, middle)
    assert screen_error(made, RADIUS, 1.5, 0.9).max() < 1e-7


def test_paths_are_reversible():
    made = scene(-squared(20), Layers((-0.16, -0.09, -0.04), (1.0, 1.3, 1.1, 1.6)))
    random = np.random.default_rng(3)
    starts = np.column_stack([random.uniform(-0.35, 0.35, (60, 2)), np.full(60, -2.0)])
    directions = random.normal([0, 0, 1], 0.05, (60, 3))
    forth, entering = (trace(made, starts, directions, depth) for depth in (16, 1))
    refracted = forth.fate == REFRACTED
    assert refracted.sum() > 40
    ends = forth.point + 2.0 * forth.direction
    back = trace(made, ends[refracted], -forth.direction[refracted])
    np.testing.assert_array_equal(back.crossed, forth.crossed[refracted])
    np.testing.assert_allclose(back.weight, forth.weight[refracted], atol=1e-7)
    # The place where the way back leaves is where the way in began to bend.
    np.testing.assert_allclose(back.point, entering.point[refracted], atol=1e-6)
    assert len(set(forth.crossed[refracted])) >= 3


def test_nested_layers_of_one_index_are_one_ball():
    first, two = ball(), scene(-squared(24), Layers((-(RADIUS**2), -0.04), (1.0, 1.5, 1.5)))
    starts = [[0.02 * k, 0.01 * k, -2.0] for k in range(13)]
    plain, nested = (trace(made, starts, [[0, 0, 1]] * 13) for made in (first, two))
    np.testing.assert_allclose(nested.direction, plain.direction, atol=1e-9)
    assert nested.crossed[0] == 4
    assert plain.crossed[0] == 2


def test_hole_refracts_in_the_opposite_direction():
    made = scene(-squared(24), Layers((-(RADIUS**2), -0.01), (1.0, 1.5, 1.0)))
    traced = trace(made, [[0.05, 0.0, -2.0]], [[0, 0, 1]])
    full = trace(ball(), [[0.05, 0.0, -2.0]], [[0, 0, 1]])
    assert full.direction[0, 0] < 0.0 < traced.direction[0, 0]


def test_total_reflection_inside_a_ball_of_air():
    # From glass into air nothing passes beyond asin(1/1.5): the ray is mirrored once and has lost nothing.
    made = scene(-squared(24), Layers((-(RADIUS**2),), (1.5, 1.0)))
    for factor, crossed in ((0.98 / 1.5, 2), (1.02 / 1.5, 1)):
        traced = trace(made, [[factor * RADIUS, 0.0, -0.5]], [[0, 0, 1]])
        assert traced.crossed[0] == crossed
    assert traced.weight[0] == 1.0
    incidence = np.arcsin(1.02 / 1.5)
    assert np.arccos(traced.direction[0, 2]) == pytest.approx(np.pi - 2.0 * incidence, abs=1e-7)


def test_an_object_cut_by_the_grid_has_flat_faces():
    # Glass everywhere: a cube. A slanted ray is shifted, and leaves as it came.
    axis = np.linspace(0.0, 1.0, 8)
    volume = 1.0 + 0.1 * axis[:, None, None] + np.zeros((8, 8, 8))
    volume[0, 0, 0] = 0.0
    made = Scene.build(Spline.from_volume(volume, "trilinear"), Layers((0.5,), (1.0, 1.5)), 1.0 / 7.0)
    tilt = 0.3
    ray = [[-0.5, 0.0, -2.0]], [[np.sin(tilt), 0.0, np.cos(tilt)]]
    traced = trace(made, *ray)
    assert traced.crossed[0] == 2
    np.testing.assert_allclose(traced.direction[0], [np.sin(tilt), 0.0, np.cos(tilt)], atol=1e-12)
    entry, leaving = trace(made, *ray, depth=1).point[0], traced.point[0]
    assert (entry[2], leaving[2]) == pytest.approx((-0.5, 0.5))
    assert leaving[0] - entry[0] == pytest.approx(np.tan(np.arcsin(np.sin(tilt) / 1.5)))


def test_a_camera_inside_sees_out():
    traced = trace(ball(), [[0.0, 0.1, 0.0]], [[0, 0, 1]])
    assert traced.crossed[0] == 1
    normal = np.array([0.1, np.sqrt(RADIUS**2 - 0.01)]) / RADIUS
    assert np.hypot(*traced.direction[0, 1:]) == pytest.approx(1.0)
    bent = normal[1] * traced.direction[0, 1] - normal[0] * traced.direction[0, 2]
    assert abs(bent) == pytest.approx(1.5 * normal[0], abs=1e-7)


def test_rays_that_miss_and_rays_that_are_lost():
    traced = trace(ball(), [[0.0, 0.0, -2.0]] * 3, [[0, 0, -1], [1, 0, 0], [0, 0, 1]], depth=1)
    assert traced.fate.tolist() == [MISSED, MISSED, LOST]
    assert traced.crossed.tolist() == [0, 0, 1]
    assert traced.weight[:2].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("name", ["central", "trilinear", "catmull-rom", "bspline2", "bspline4", "bspline6"])
def test_every_filter_and_root_finder_sees_the_ball(name):
    volume = RADIUS - distance(48)
    made = Scene.build(Spline.from_volume(volume, name), Layers((0.0,), (1.0, 1.5)), 1.0 / 47)
    kinds = [("certain", "octree"), ("brent", "dda"), ("brent", "steps")]
    for roots, structure in [*kinds, ("analytic", "octree")] if made.linear else kinds:
        error = screen_error(made, RADIUS, 1.5, 0.8, structure=structure, roots=roots)
        assert np.median(error) < (0.05 if made.linear else 2e-3)


def test_8_bit_volumes_refract_within_rounding():
    volume = np.round(127.5 + 400.0 * (RADIUS - distance(48))).clip(0, 255)
    errors = []
    for smoothing in (0.0, 1.0):
        spline = Spline(volume, smoothing=smoothing)
        made = Scene.build(spline, Layers((127.5,), (1.0, 1.5)), 1.0 / 47)
        errors.append(np.median(screen_error(made, RADIUS, 1.5, 0.8)))
    # Rounding to 1/29 of a spacing tilts the normals; smoothing averages it (3.3.2).
    assert errors[1] < 0.5 * errors[0]
    assert errors[1] < 0.02


def test_a_point_without_a_normal_lets_rays_straight_through():
    # At the top of a saddle the gradient is 0; a ray that meets the surface there goes on as it came.
    axis = np.linspace(-1.0, 1.0, 9)
    volume = axis[:, None, None] * axis[None, :, None] + np.zeros((9, 9, 9)) + 0.0 * axis
    made = Scene.build(Spline.from_volume(volume, "trilinear"), Layers((0.0,), (1.0, 1.5)), 0.25)
    traced = trace(made, [[-0.999, 0.999, 0.0]], [[1.0, -1.0, 0.0]])
    assert np.isfinite(traced.direction).all()
    assert np.linalg.norm(traced.direction[0]) == pytest.approx(1.0)


def plateaus() -> list[Scene]:
    """Volumes that are 0, or 1, over large parts, looked at by just that iso-value."""
    half_open = (100.0 * (0.4 - distance(24))).clip(0.0, 40.0)
    mask = (distance(24) < 0.3).astype(np.uint8)
    ways = [(half_open, 0.0, "bspline3"), (mask, 0.0, "bspline3"), (mask, 1.0, "bspline6")]
    ways += [(mask, 0.0, "catmull-rom"), (mask, 1.0, "catmull-rom"), (mask, 0.0, "trilinear")]
    return [
        Scene.build(Spline.from_volume(volume, name), Layers((iso,), (1.0, 1.5)), 1.0 / 23)
        for volume, iso, name in ways
    ]


def test_rays_that_run_along_a_surface_for_long_are_lost():
    random = np.random.default_rng(5)
    starts = np.column_stack([random.uniform(-0.45, 0.45, (40, 2)), np.full(40, -2.0)])
    ahead = random.normal([0, 0, 1], 0.05, (40, 3))
    for made in plateaus():
        traced = trace(made, starts, ahead, depth=200)
        assert (traced.fate == LOST).any()
        assert np.isfinite(traced.point).all()
        assert np.isfinite(traced.direction).all()
    # Given up by the search, short of the most interfaces.
    first = trace(plateaus()[1], starts, ahead, depth=200)
    given_up = (first.fate == LOST) & (first.crossed < 200)
    assert given_up.sum() >= 10

"""Ray-traced pictures: known optics, energy conservation, transforms, and every lookup of the fields."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.geometry_field.tables.inner_field import spread_points
from bentray_kernels.geometry_field.tables.reference_field import reference_field
from bentray_kernels.geometry_field.tracing.lookup_scene import UV_WAYS, WAYS
from bentray_kernels.geometry_field.tracing.packed_scene import world_of
from bentray_kernels.geometry_field.tracing.ray_tracer import TraceSettings, trace
from bentray_kernels.geometry_field.tracing.scene import Ground, Instance, Material, Scene, Shape, placed
from bentray_kernels.meshes.mesh import Chart, TriangleMesh
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.refraction import Camera, perspective

from ..shapes import dented, field_of, inner_of, octahedron, over_the_poles, turned

SIZE = 40
WHITE = np.ones((4, 8, 3))


@cache
def round_shape() -> Shape:
    surface = surface_of(over_the_poles(turned(octahedron(4))))
    return Shape(surface, field_of(surface, 10), inner_of(surface, 8, 8))


@cache
def dented_shape() -> Shape:
    surface = surface_of(over_the_poles(dented(4)))
    return Shape(surface, field_of(surface, 10), inner_of(surface, 8, 12))


def striped(rows: int = 32) -> np.ndarray:
    """An environment without symmetry."""
    v, u = np.mgrid[0:rows, 0 : 2 * rows] / rows
    return np.clip(np.stack([v, 0.5 + 0.4 * np.sin(5.0 * u), 1.0 - 0.4 * u * v], axis=-1), 0.0, 1.0)


def picture(scene: Scene, camera: Camera | None = None, **how) -> np.ndarray:
    camera = camera or perspective((0.3, -3.0, 0.9), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)
    return trace(world_of(scene), camera, TraceSettings(SIZE, SIZE, **how)).astype(int)


def ball(
    material: Material, shape: Shape | None = None, environment: np.ndarray | None = None, **how
) -> Scene:
    """One body in the middle, by default the round one among stripes."""
    body = Instance(shape or round_shape(), placed((0.0, 0.0, 0.0), 1.0), material)
    return Scene((body,), striped() if environment is None else environment, **how)


# Out of sight.
AWAY = Instance(round_shape(), placed((0.0, 0.0, 90.0), 1.0))


def crowded(**how) -> Scene:
    checks = np.indices((6, 12)).sum(axis=0)[..., None] % 2 * np.array([0.9, 0.3, 0.1])
    return Scene(
        (
            Instance(round_shape(), placed((0.0, 0.0, 0.0), 0.8), Material(mirror=0.8)),
            Instance(round_shape(), placed((-0.9, 0.1, -0.1), 0.6), Material(texture=checks)),
            Instance(
                dented_shape(), placed((0.9, 0.1, 0.0), 0.8, (1.0, 0.0, 0.0), 50.0), Material(mirror=0.7)
            ),
            Instance(round_shape(), placed((0.35, -0.8, -0.2), 0.5), Material(glass=0.9)),
        ),
        striped(),
        **how,
    )


@pytest.mark.parametrize("way", WAYS)
def test_a_white_furnace_stays_white(way):
    white = Material(colour=(1.0, 1.0, 1.0))
    parts = (
        (round_shape(), (-0.6, 0.0, -0.3), {"mirror": 0.6}),
        (dented_shape(), (0.5, -0.2, -0.3), {"glass": 0.7}),
        (dented_shape(), (0.0, 0.1, 0.5), {"mirror": 1.0}),
        (round_shape(), (0.2, -0.9, 0.2), {}),
    )
    instances = tuple(
        Instance(shape, placed(place, 0.8), replace(white, **shares)) for shape, place, shares in parts
    )
    for depth in (0, 1, 5):
        assert (picture(Scene(instances, WHITE, ambient=1.0), way=way, depth=depth) == 255).all()


def test_depth_adds_what_further_surfaces_show():
    scene = crowded()
    pictures = [picture(scene, depth=depth) for depth in (0, 1, 2, 3)]
    changed = [np.mean((a != b).any(axis=2)) for a, b in pairwise(pictures)]
    assert all(share > 0.0 for share in changed)
    assert changed[0] > changed[1] > changed[2]


def test_a_mirror_ball_shows_what_lies_behind_the_eye():
    scene = ball(Material(mirror=1.0))
    camera = perspective((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5)
    behind = perspective((0.0, -3.0, 0.0), (0.0, -6.0, 0.0), (0.0, 0.0, 1.0), 0.5)
    middle = picture(scene, camera)[SIZE // 2, SIZE // 2]
    np.testing.assert_allclose(middle, picture(scene, behind)[SIZE // 2, SIZE // 2], atol=6)


def test_a_glass_ball_turns_the_surroundings_upside_down():
    half = np.zeros((32, 64, 3))
    half[:16] = 1.0
    camera = perspective((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 20.0)
    for refraction, upright in (("full", False), ("single", False)):
        seen = picture(ball(Material(glass=1.0, refraction=refraction), environment=half), camera)
        column = seen[8:-8, SIZE // 2, 0]
        assert (column[0] > column[-1]) == upright
    # Of the index of its surroundings it is not seen.
    clear = picture(ball(Material(glass=1.0, index=1.0)), camera)
    nothing = picture(Scene((AWAY,), striped()), camera)
    assert np.abs(clear - nothing).max() <= 1


@pytest.mark.parametrize("index", [1.3, 1.5, 2.0])
def test_rays_through_a_ball_obey_snells_law(index):
    surface = surface_of(over_the_poles(turned(octahedron(6))))
    ramp = np.repeat(np.linspace(0.0, 1.0, 512)[:, None, None], 8, axis=1) * np.ones(3)
    material = Material(glass=1.0, index=index)
    scene = Scene((Instance(Shape(surface), placed((0.0, 0.0, 0.0), 2.0), material),), ramp)
    camera = perspective((0.0, -60.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2.0)
    column = trace(world_of(scene), camera, TraceSettings(81, 81)).astype(float)[:, 40, 0]
    heights = np.tan(np.deg2rad(1.0)) * 60.0 * (1.0 - 2.0 * (np.arange(81) + 0.5) / 81)
    inside = np.abs(heights) < 0.9
    into = np.arcsin(heights[inside])
    # Towards the middle twice, by the difference of both angles.
    rises = -2.0 * (into - np.arcsin(heights[inside] / index))
    expected = 255.0 * (0.5 - rises / np.pi)
    # The eye's rays are not quite parallel.
    np.testing.assert_allclose(column[inside], expected, atol=3.0)


def test_total_internal_reflection():
    # Within a cube of index 2 no ray that came in by one side leaves by the next: it is mirrored on.
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces, vertices = [], []
    for quad in quads:
        first = len(vertices)
        vertices += [corners[k] for k in quad]
        faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    mesh = TriangleMesh(np.array(vertices), np.array(faces, dtype=np.int32))
    surface = surface_of(Chart(mesh, np.zeros((12, 3, 2))))
    sky = np.zeros((64, 128, 3))
    sky[:8] = 1.0
    scene = ball(Material(glass=1.0, index=2.0), Shape(surface), sky)
    # In by the top, to a side, mirrored there, out by the floor: never the bright zenith.
    camera = perspective((0.35, -0.9, 2.0), (0.1, -0.2, 0.5), (0.0, 1.0, 0.0), 3.0)
    assert picture(scene, camera, depth=8).max() == 0


def test_self_reflection_only_on_request():
    seeing = Material(mirror=1.0)
    camera = perspective((0.2, -1.2, 2.2), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 35.0)
    blind = replace(seeing, self_reflection=False)
    round_off, dented_off = (
        np.mean((picture(ball(seeing, shape), camera) != picture(ball(blind, shape), camera)).any(axis=2))
        for shape in (round_shape(), dented_shape())
    )
    assert round_off == 0.0
    assert dented_off > 0.005


def test_moving_everything_alike_changes_nothing():
    turn = placed((0.4, -0.3, 0.0), 1.7, (0.0, 0.0, 1.0), 37.0)
    linear, shift = turn[:, :3], turn[:, 3]

    def moved(instance: Instance) -> Instance:
        matrix = instance.to_world
        return replace(
            instance, to_world=np.column_stack([linear @ matrix[:, :3], linear @ matrix[:, 3] + shift])
        )

    camera = perspective((0.3, -3.0, 0.9), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 45.0)
    eye = camera.origin @ linear.T
    eye[0] += shift
    there = Camera(eye, camera.direction @ linear.T)
    scene = replace(crowded(), environment=np.full((2, 4, 3), 0.4), light=(0.0, 0.0, 1.0))
    other = replace(scene, instances=tuple(map(moved, scene.instances)))
    a, b = picture(scene, camera), picture(other, there)
    assert np.mean(np.abs(a - b).max(axis=2) > 1) < 0.005


@given(scale=st.floats(0.2, 5.0), axis=st.integers(0, 2))
@settings(max_examples=8, deadline=None)
def test_a_stretched_ball_is_the_ellipsoid(scale, axis):
    factor = np.ones(3)
    factor[axis] = scale
    matrix = np.column_stack([np.diag(factor), -0.5 * factor])
    material = Material(colour=(1.0, 1.0, 1.0))
    scene = Scene((Instance(round_shape(), matrix, material),), np.zeros((2, 4, 3)), ambient=0.0)
    eye = np.array([0.4, -9.0, 0.7])
    camera = perspective(eye, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0)
    seen = picture(scene, camera, eye="exact")
    light = np.asarray(scene.light) / np.linalg.norm(scene.light)
    v, u = (np.mgrid[0:SIZE, 0:SIZE] + 0.5) / SIZE - 0.5
    ahead = camera.direction[0] + u[..., None] * camera.direction[1] + v[..., None] * camera.direction[2]
    a, b = ahead / factor, eye / factor
    half, square = (a * b).sum(axis=-1), (a * a).sum(axis=-1)
    inside = half**2 - square * (b @ b - 0.25)
    with np.errstate(invalid="ignore"):
        s = (-half - np.sqrt(inside)) / square
    normal = (eye + s[..., None] * ahead) / factor**2
    shown = np.clip((normal @ light) / np.linalg.norm(normal, axis=-1), 0.0, 1.0)
    clear = inside > 0.05 * square
    np.testing.assert_allclose(seen[clear][:, 0], 255.0 * shown[clear], atol=12.0)
    assert (seen[inside < -0.02 * square] == 0).all()


def test_the_walk_makes_the_exact_picture():
    exact = picture(crowded(), way="exact")
    odd = {
        way: float(np.mean(np.abs(picture(crowded(), way=way) - exact).max(axis=2) > 8))
        for way in ("walk", "plane", "linear", "nearest")
    }
    assert odd["walk"] < 0.02
    assert odd["walk"] <= min(odd["plane"], odd["linear"]) <= odd["nearest"]


def test_primary_rays_can_use_the_field():
    exact, walk, nearest = (picture(crowded(), eye=eye) for eye in ("exact", "walk", "nearest"))
    assert np.mean(np.abs(exact - walk).max(axis=2) > 8) < 0.01
    assert np.mean(np.abs(exact - nearest).max(axis=2) > 8) > 0.03


@cache
def published_shape() -> Shape:
    """A conformal chart, without a table for rays that leave it: these are exact."""
    chart = parameterise(turned(octahedron(4))).chart
    surface, image = surface_of(chart), geometry_image(chart, 129)
    outer = field_of(surface, 16)
    reference = reference_field(surface, outer, image.positions, image.normals, image.valid)
    return Shape(surface, outer, reference=reference)


@cache
def wholly_published_shape() -> Shape:
    """The published shape with both inner fields."""
    shape, chart = published_shape(), parameterise(turned(octahedron(4))).chart
    image, points = geometry_image(chart, 129), spread_points(shape.surface, 12)[0]
    inner = inner_of(shape.surface, 12, 12)
    reference = reference_field(
        shape.surface, shape.outer, image.positions, image.normals, image.valid, (inner, points)
    )
    return Shape(shape.surface, shape.outer, inner, reference)


def published(material: Material, **reference) -> Scene:
    """The ball on a checkerboard, with arrays of its reference field replaced."""
    shape = published_shape()
    shape = replace(shape, reference=shape.reference._replace(**reference))
    ground = Ground(-0.6, 0.4, 5.0)
    position = placed((0.1, 0.2, 0.0), 1.2, (0.2, 0.1, 1.0), 25.0)
    return Scene((Instance(shape, position, material),), striped(), ground)


def test_published_lookups_make_nearly_the_exact_picture():
    scene = published(Material(colour=(0.9, 0.5, 0.3)))
    exact = picture(scene)
    off = {way: np.abs(picture(scene, eye=way) - exact).max(axis=2) for way in (*UV_WAYS, "walk")}
    # Nearest (u, v) is a mosaic, averages err at seam and silhouette, the walk only at the silhouette.
    assert np.median(off["uv-linear"][exact.std(axis=2) > 0]) <= np.median(off["uv-nearest"])
    assert (off["uv-linear"] > 16).mean() < 0.1
    assert (off["uv-nearest"] > 32).mean() < 0.15
    assert (off["walk"] > 16).mean() < (off["uv-linear"] > 16).mean()
    glass = published(Material(glass=0.9))
    for way in UV_WAYS:
        changed = np.abs(picture(glass, eye=way, way=way) - picture(glass, way="exact")).max(axis=2)
        assert 0.0 < (changed > 8).mean() < 0.5


@pytest.mark.parametrize("way", UV_WAYS)
def test_published_lookups_read_the_image(way):
    image = published_shape().reference.image
    dark = image.copy()
    dark[..., 3:] *= -1.0
    material = Material(colour=(1.0, 1.0, 1.0))
    plain = picture(published(material), eye=way)
    turned_over = picture(published(material, image=dark), eye=way)
    shown = (plain != turned_over).any(axis=2)
    # Normals away from the light show the ambient share alone.
    assert shown.mean() > 0.05
    assert np.isin(turned_over[shown & (plain > 80).all(axis=2)], (76, 77)).all()
    moved = image.copy()
    moved[..., :3] = 0.5
    mirror = Material(mirror=1.0)
    assert (picture(published(mirror), eye=way) != picture(published(mirror, image=moved), eye=way)).any()
    nowhere = picture(published(material, image=np.full_like(image, np.nan)), eye=way)
    np.testing.assert_array_equal(nowhere, picture(replace(published(material), instances=(AWAY,))))


@pytest.mark.parametrize("way", UV_WAYS)
def test_published_hits_are_as_far_as_they_are(way):
    # A wall just behind the ball, and a mirror that sees both: a farther ball would be behind the wall.
    scene = published(Material(colour=(1.0, 0.0, 0.0)))
    low = replace(scene, ground=Ground(-0.2, 0.4, 5.0, ((0.0, 1.0, 0.0), (0.0, 1.0, 0.0))), ambient=1.0)
    camera = perspective((0.0, -0.6, 4.0), (0.1, 0.2, 0.0), (0.0, 1.0, 0.0), 25.0)
    exact, result = picture(low, camera), picture(low, camera, eye=way)
    assert (exact[..., 0] == 255).mean() > 0.3
    assert np.mean((exact != result).any(axis=2)) < 0.06


@pytest.mark.parametrize("way", UV_WAYS)
def test_rays_within_a_body_leave_it_by_the_image(way):
    image = published_shape().reference.image
    scene = published(Material(glass=1.0))
    away = scene.instances[0].to_world[:, :3].T @ np.array([0.0, 1.0, 0.0]) / 1.2
    behind = (image[..., :3] - 0.5) @ away > 0.2
    flat = image.copy()
    flat[behind, 3:] = away
    plain = picture(scene, eye=way, way=way)
    other = picture(published(Material(glass=1.0), image=flat), eye=way, way=way)
    # Where rays come in the image is the same.
    assert np.mean((plain != other).any(axis=2)) > 0.05


@pytest.mark.parametrize("way", UV_WAYS)
def test_rays_that_leave_the_surface_use_the_published_inner_field(way):
    shape, scene = wholly_published_shape(), published(Material(glass=1.0))

    def drawn(**arrays) -> np.ndarray:
        changed = replace(shape, reference=shape.reference._replace(**arrays))
        body = replace(scene.instances[0], shape=changed)
        return picture(replace(scene, instances=(body,)), way=way)

    plain, walked = drawn(), drawn(inner_uv=None)
    exact = picture(scene, way="exact")
    # Coarser than the walk, but a picture of the same refraction.
    off = [(np.abs(drawn - exact).max(axis=2) > 16).mean() for drawn in (plain, walked)]
    assert off[1] < off[0] < 0.5
    # Each ray ends at the recorded point: one and the same for all rays, and none at all.
    body = (picture(scene, depth=0) != picture(replace(scene, instances=(AWAY,)), depth=0)).any(axis=2)
    recorded = shape.reference.inner_uv[np.isfinite(shape.reference.inner_uv).all(axis=-1)]
    one_point = drawn(inner_uv=np.full_like(shape.reference.inner_uv, 1.0) * recorded[len(recorded) // 2])
    nowhere = drawn(inner_uv=np.full_like(shape.reference.inner_uv, np.nan))
    assert (plain != one_point).any(axis=2)[body].mean() > 0.2
    assert (nowhere != one_point).any(axis=2)[body].mean() > 0.2


def test_pictures_do_not_depend_on_threads_or_runs():
    picture_of = picture(crowded())
    np.testing.assert_array_equal(picture_of, picture(crowded(), threads=2))
    np.testing.assert_array_equal(picture_of, picture(crowded()))


def test_the_ground_is_a_checkerboard_of_metres():
    ground = Ground(-1.0, 0.5, 4.0, ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    camera = perspective((0.0, 0.0, 4.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), 90.0)
    seen = picture(Scene((AWAY,), WHITE, ground), camera)
    # Ten metres across and forty pixels: squares of two pixels, a disc of four metres.
    x = (np.arange(SIZE) + 0.5) / SIZE * 10.0 - 5.0
    odd = (np.floor(x[None, :] / 0.5) + np.floor(-x[:, None] / 0.5)) % 2 == 1
    disc = np.hypot(x[None, :], x[:, None]) < 3.9
    np.testing.assert_array_equal(seen[disc & odd], np.tile([0, 0, 255], ((disc & odd).sum(), 1)))
    np.testing.assert_array_equal(seen[disc & ~odd], np.tile([255, 0, 0], ((disc & ~odd).sum(), 1)))
    assert (seen[np.hypot(x[None, :], x[:, None]) > 4.1] == 255).all()


def test_rays_that_start_in_the_cube_of_another_body_see_it():
    # The small mirror lies in the dent, within the other's cube: entries behind it are not for its rays.
    bowl = Instance(dented_shape(), placed((0.0, 0.0, 0.0), 2.0), Material(colour=(1.0, 0.0, 0.0)))
    pearl = Instance(round_shape(), placed((0.0, 0.0, 0.45), 0.4), Material(mirror=1.0))
    scene = Scene((bowl, pearl), np.zeros((2, 4, 3)), ambient=1.0)
    camera = perspective((0.1, -0.3, 3.0), (0.0, 0.0, 0.45), (0.0, 1.0, 0.0), 9.0)
    a, b = picture(scene, camera, way="walk"), picture(scene, camera, way="exact")
    assert b[..., 0].any()
    assert np.mean(np.abs(a - b).max(axis=2) > 1) < 0.03


@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("mirror", lambda: Material(mirror=1.2)),
        ("glass", lambda: Material(mirror=0.5, glass=0.5)),
        ("index", lambda: Material(glass=1.0, index=0.0)),
        ("refraction", lambda: Material(refraction="half")),
        ("colour", lambda: Material(colour=(2.0, 0.0, 0.0))),
        ("texture", lambda: Material(texture=np.ones((4, 4)))),
        ("to_world", lambda: Instance(round_shape(), np.eye(3))),
        ("to_world", lambda: Instance(round_shape(), np.diag([1.0, 1.0, -1.0, 1.0])[:3])),
        ("square_m", lambda: Ground(0.0, 0.0, 1.0)),
        ("radius_m", lambda: Ground(0.0, 1.0, np.inf)),
        ("height_m", lambda: Ground(np.nan, 1.0, 1.0)),
        ("instances", lambda: Scene((), WHITE)),
        ("environment", lambda: Scene((AWAY,), 300.0 * WHITE)),
        ("light", lambda: Scene((AWAY,), WHITE, light=(0.0, 0.0, 0.0))),
        ("ambient", lambda: Scene((AWAY,), WHITE, ambient=-1.0)),
        ("reference", lambda: Shape(round_shape().surface, reference=published_shape().reference)),
        ("reference", lambda: replace(wholly_published_shape(), inner=None)),
        ("depth", lambda: TraceSettings(depth=-1)),
        ("rows", lambda: TraceSettings(rows=0)),
        ("way", lambda: TraceSettings(way="furthest")),
    ],
)
def test_rejects_invalid_pictures(field, make):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        make()

"""The caster on an OpenCL device: all cases of the compiled one, its rays, its pictures, its refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import OpenCLFallbackWarning, session_or_warning
from bentray_kernels.opencl.program import Program
from bentray_kernels.refraction import (
    Layers,
    Picture,
    RenderSettings,
    Scene,
    caster_opencl,
    orthographic,
    perspective,
    render,
)
from bentray_kernels.refraction.caster import LOST, REFRACTED, Traced, allocate_results, cast, medium_of
from bentray_kernels.refraction.caster_opencl import OpenCLCaster, Rays
from bentray_kernels.splines import Spline

from ...effort import effort
from . import test_caster
from .solids import BACKDROP, distance, squared, through_ball
from .test_caster import *  # noqa: F403 - every case of the compiled caster, cast by the fixture below

pytestmark = pytest.mark.opencl

RADIUS = 0.31
CAMERAS = {
    "orthographic": orthographic((0.0, 0.0, -2.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), 1.0),
    "perspective": perspective((0.3, -0.4, -1.9), (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 35.0),
}


def caster_of(scene: Scene, precision: str = "float64") -> OpenCLCaster:
    made = OpenCLCaster.on_the_device(scene, precision)
    assert made is not None
    return made


@pytest.fixture(autouse=True)
def cast_by_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets the cases of ``test_caster`` ask the device; where it is not trusted its warning is an error."""

    def trace(scene, starts, directions, depth=16, structure="octree", roots="certain") -> Traced:
        starts, directions = np.atleast_2d(starts).astype(float), np.atleast_2d(directions).astype(float)
        traced = allocate_results(len(starts))
        medium, search = medium_of(scene, structure), scene.search(structure, roots, 0.05)
        caster, still = caster_of(scene), np.zeros((2, 3))
        for n, (start, ahead) in enumerate(zip(starts, directions, strict=True)):
            camera = np.vstack([start, still]), np.vstack([ahead, still])
            caster.cast(medium, search, camera, np.zeros((1, 2)), depth, traced.part(slice(n, n + 1)))
        return traced

    monkeypatch.setattr(test_caster, "trace", trace)


def nested(n: int = 24, **how) -> Scene:
    layers = Layers((-(RADIUS**2), -0.04, -0.01), (1.0, 1.4, 1.1, 1.7))
    return Scene.build(Spline(-squared(n), prefilter=False, **how), layers, 1.0 / (n - 1))


def rough(seed: int, name: str, dtype=np.float64) -> Scene:
    """A volume without any smoothness, often cut by the grid's faces, in any of its three layers."""
    random = np.random.default_rng(seed)
    volume = np.pad(random.normal(0.0, 1.0, random.integers(3, 9, 3)), seed % 3, constant_values=-3.0)
    low, high = np.sort(random.normal(0.0, 0.3, 2))
    indices = tuple(random.uniform(1.0, 1.8, 3))
    layers = Layers((low, high), indices, int(random.integers(3)))
    return Scene.build(Spline.from_volume(volume, name, dtype=dtype), layers, 0.1)


def both(
    scene: Scene,
    precision="float64",
    structure="octree",
    roots="certain",
    depth=16,
    seed=0,
    compiled: Scene | None = None,
) -> tuple[Traced, Traced]:
    """300 rays of a camera somewhere about the scene, by the device and by the compiled caster.

    The latter traces another scene where one is given.
    """
    random = np.random.default_rng(seed)
    eye = 3.0 * np.linalg.norm(scene.spacing * scene.grid[1]) * _unit(random.normal(size=3))
    camera = perspective(eye, (0.0, 0.0, 0.0), random.normal(size=3), 14.0)
    points = random.uniform(-0.5, 0.5, (300, 2))
    medium, search = medium_of(scene, structure), scene.search(structure, roots, 0.1)
    computed, expected = (allocate_results(300) for _ in range(2))
    views = camera.origin, camera.direction
    caster_of(scene, precision).follow(Rays(medium, search, views, points, depth, computed))
    if compiled is not None:
        medium, search = medium_of(compiled, structure), compiled.search(structure, roots, 0.1)
    cast(medium, search, views, points, depth, expected)
    return computed, expected


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def strays(computed: Traced, expected: Traced, far: float) -> int:
    """Rays that became something else, or are farther off than so much."""
    same = (computed.fate == expected.fate) & (computed.crossed == expected.crossed)
    for name in ("point", "direction", "weight"):
        off = np.abs(getattr(computed, name) - getattr(expected, name)).reshape(len(same), -1).max(axis=1)
        same &= off <= far
    return int((~same).sum())


@pytest.mark.parametrize(
    ("name", "roots", "structure"),
    [
        ("bspline2", "certain", "octree"),
        pytest.param("bspline4", "brent", "dda", marks=pytest.mark.nightly),
        pytest.param("bspline6", "brent", "steps", marks=pytest.mark.nightly),
    ],
)
def test_every_filter_and_root_finder_sees_the_ball(name, roots, structure):
    """In place of the case above: each filter with each root finder takes seconds to build.

    The other filters meet every root finder below.
    """
    made = Scene.build(Spline.from_volume(RADIUS - distance(48), name), Layers((0.0,), (1.0, 1.5)), 1.0 / 47)
    error = test_caster.screen_error(made, RADIUS, 1.5, 0.8, structure=structure, roots=roots)
    assert np.median(error) < 2e-3


@pytest.mark.parametrize("roots", ["certain", "brent"])
def test_rays_through_nested_surfaces_are_those_of_the_compiled_caster(roots):
    computed, expected = both(nested(), roots=roots)
    assert (expected.fate == REFRACTED).sum() > 50
    assert len(set(expected.crossed)) >= 4
    assert strays(computed, expected, 1e-9) == 0
    # With fewer interfaces a ray ends at the last one.
    for depth in range(1, 5):
        assert strays(*both(nested(), roots=roots, depth=depth), 1e-9) == 0


@pytest.mark.parametrize(
    "name",
    [
        "trilinear",
        "bspline3",
        *(pytest.param(name, marks=pytest.mark.nightly) for name in ("central", "catmull-rom", "bspline5")),
    ],
)
def test_rays_through_rough_volumes_too(name):
    @given(seed=st.integers(0, 2**32 - 1))
    @settings(max_examples=effort(4, 12), deadline=None)
    def holds(seed):
        scene = rough(seed, name)
        kinds = [("octree", "certain"), ("dda", "brent"), ("steps", "brent")]
        for structure, roots in [*kinds, ("octree", "analytic")] if scene.linear else kinds:
            computed, expected = both(scene, structure=structure, roots=roots, depth=3, seed=seed)
            # What grazes a surface may go either way. Central differences are not the slopes of the values: a
            # ray may go on in a layer that the values deny, and rounding decides what it meets next.
            assert strays(computed, expected, 1e-6) <= (30 if name == "central" else 3)

    holds()


def test_volumes_in_float32_are_summed_in_float32():
    # The caster takes ten seconds to compile for float32.
    computed, expected = both(nested(dtype=np.float32), compiled=nested())
    assert strays(computed, expected, 1e-9) > 0
    assert strays(computed, expected, 1e-4) <= 3


def test_float32_finds_directions_to_a_thousandth():
    for scene in (nested(), rough(1, "bspline3"), rough(3, "trilinear")):
        computed, expected = both(scene, "float32", depth=3)
        assert strays(computed, expected, 1e-9) > 0
        assert strays(computed, expected, 1e-3) <= 6


def test_rays_that_run_along_a_surface_for_long_are_lost():
    """In place of the case above: with the most interfaces there, rounding decides what those rays meet."""
    mask = (distance(24) < 0.3).astype(np.uint8)
    scene = Scene.build(Spline.from_volume(mask, "bspline6"), Layers((1.0,), (1.0, 1.5)), 1.0 / 23)
    computed, expected = both(scene, depth=200)
    given_up = (expected.fate == LOST) & (expected.crossed < 200)
    assert given_up.sum() >= 10
    assert strays(computed, expected, 1e-6) <= 3
    # Where hardly any ray is sure, the device is not believed.
    rippled = Scene.build(Spline(mask), Layers((0.0,), (1.0, 1.5)), 1.0 / 23)
    with pytest.warns(OpenCLFallbackWarning, match="caster.cast takes over"):
        test_caster.trace(rippled, [[0.1, 0.1, -2.0]], [[0.0, 0.0, 1.0]])


def test_the_backdrop_behind_a_ball_is_seen_exactly_where_it_is():
    layers = Layers((-(RADIUS**2),), (1.0, 1.5))
    scene = Scene.build(Spline(-squared(24), prefilter=False), layers, 1.0 / 23)
    how = RenderSettings(64, 64, supersampling="none")
    u, v = np.meshgrid(*[(np.arange(64) + 0.5) / 64 - 0.5] * 2)
    radius = np.hypot(u, v)
    clear, inside = np.abs(radius - RADIUS) > 1e-3, radius < 0.97 * RADIUS
    exact = through_ball(radius[inside], RADIUS, 1.5, 1.0)[0] / radius[inside]
    for precision, far in (("float64", 1e-7), ("float32", 1e-3)):
        made = render(scene, CAMERAS["orthographic"], BACKDROP, how, caster_of(scene, precision))
        np.testing.assert_array_equal(made.crossed[clear], 2 * (radius < RADIUS)[clear])
        np.testing.assert_allclose(
            made.position_m[inside], np.stack([u, v], -1)[inside] * exact[:, None], atol=far
        )


def at_discontinuities(picture: Picture) -> np.ndarray:
    """Pixels with a neighbour of another colour, or whose ray met another number of interfaces."""
    seen = np.concatenate([picture.image.astype(int), picture.crossed[..., None]], axis=2)
    padded = np.pad(seen, ((1, 1), (1, 1), (0, 0)), mode="edge")
    rows, columns = seen.shape[:2]
    around = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return np.any([(other != seen).any(axis=2) for other in around], axis=0)


# Pixels out of 96² that may differ by more than one level of 255: 0.02 % and 0.5 %.
@pytest.mark.parametrize(("precision", "most"), [("float64", 2), ("float32", 46)])
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("supersampling", ["none", "prss", "real"])
def test_pictures_differ_by_a_level_but_at_discontinuities(precision, most, camera, supersampling):
    how = RenderSettings(96, 96, supersampling=supersampling, degree=2, fresnel=True)
    for scene in (nested(), Scene.build(Spline(RADIUS - distance(32)), Layers((0.0,), (1.0, 1.5)), 1.0 / 31)):
        expected = render(scene, CAMERAS[camera], BACKDROP, how)
        plain = render(scene, CAMERAS[camera], BACKDROP, RenderSettings(96, 96, supersampling="none"))
        computed = render(scene, CAMERAS[camera], BACKDROP, how, caster_of(scene, precision))
        off = np.abs(computed.image.astype(int) - expected.image).max(axis=2) > 1
        assert (expected.image != 255).any()
        assert off.sum() <= most
        assert at_discontinuities(plain)[off].all()


def test_many_rays_are_cast_in_parts(monkeypatch):
    scene = nested()
    whole, _ = both(scene)
    monkeypatch.setattr(type(session_or_warning(instead="cast")), "doubles_at_once", lambda session: 61 * 41)
    for part, all_at_once in zip(both(scene)[0], whole, strict=True):
        np.testing.assert_array_equal(part, all_at_once)


def test_no_rays_give_empty_results():
    scene, none = nested(), allocate_results(0)
    view = CAMERAS["orthographic"]
    caster_of(scene).cast(
        medium_of(scene, "octree"), scene.search(), (view.origin, view.direction), np.empty((0, 2)), 4, none
    )
    assert len(none.point) == 0


def test_a_device_that_casts_wrong_is_left_with_a_warning(monkeypatch):
    scene = nested()
    caster, right, seen = caster_of(scene), OpenCLCaster.follow, CAMERAS["perspective"]

    def wrong(there, rays):
        right(there, rays)
        rays.traced.direction[:, 0] += 1e-3

    monkeypatch.setattr(OpenCLCaster, "follow", wrong)
    how = RenderSettings(24, 24)
    expected = render(scene, seen, BACKDROP, how)
    with pytest.warns(
        OpenCLFallbackWarning, match=r"\(certain\), caster.cast takes over: 100% of its"
    ) as caught:
        computed = [render(scene, seen, BACKDROP, how, caster) for _ in range(2)]
    assert len(caught) == 1
    for picture in computed:
        np.testing.assert_array_equal(picture.image, expected.image)
    # Each way to look for crossings is a program of its own, and has its own trial.
    monkeypatch.setattr(OpenCLCaster, "follow", right)
    brent = RenderSettings(24, 24, roots="brent")
    render(scene, seen, BACKDROP, brent, caster)


def test_a_device_that_cannot_build_the_program_is_left_too(monkeypatch):
    scene = nested()
    nonsense = Program(caster_opencl.SOURCES, ("REAL=nonsense",))
    monkeypatch.setattr(caster_opencl, "_program", lambda *_: nonsense)
    caster, how = caster_of(scene), RenderSettings(16, 16)
    with pytest.warns(OpenCLFallbackWarning, match="caster.cast takes over: it ends with "):
        computed = render(scene, CAMERAS["perspective"], BACKDROP, how, caster)
    expected = render(scene, CAMERAS["perspective"], BACKDROP, how)
    np.testing.assert_array_equal(computed.image, expected.image)


def test_a_scene_that_the_device_cannot_hold_is_left_to_the_cpu(monkeypatch):
    import pyopencl as cl

    def full(*_):
        raise cl.MemoryError("create_buffer", cl.status_code.MEM_OBJECT_ALLOCATION_FAILURE)

    monkeypatch.setattr(type(session_or_warning(instead="cast")), "upload", full)
    with pytest.warns(OpenCLFallbackWarning, match="cannot hold the scene"):
        assert OpenCLCaster.on_the_device(nested()) is None


def test_rejects_objects_of_another_scene():
    first, other = nested(), nested(12)
    with pytest.raises(InvalidInput, match=r"^medium: found"):
        render(other, CAMERAS["perspective"], BACKDROP, RenderSettings(8, 8), caster_of(first))
    with pytest.raises(InvalidInput, match=r"^precision: found"):
        OpenCLCaster.on_the_device(first, "float16")

"""Scenes of chapter 5: mirrors, glass and self-reflection, before a procedural landscape."""

from collections.abc import Callable
from functools import cache

import numpy as np

from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from bentray_kernels.geometry_field.tracing.scene import Ground, Instance, Material, Scene, Shape, placed
from bentray_kernels.meshes.example_surfaces import sphere, torus
from bentray_kernels.meshes.mesh import Chart, TriangleMesh
from bentray_kernels.meshes.surface import surface_of
from bentray_kernels.refraction import Camera, perspective

from ._field_rays import build_outer_field, load_mesh

# Samples along an edge of the cube for the outer and the inner field, and divisions for the latter's points.
OUTER, INNER, DIVISIONS = 24, 16, 16

UPRIGHT = (1.0, 0.0, 0.0)
RED, BLUE, CLAY = (0.85, 0.25, 0.2), (0.25, 0.4, 0.85), (0.8, 0.6, 0.45)
GROUND = Ground(0.0, 0.5, 7.0, ((0.85, 0.83, 0.78), (0.3, 0.34, 0.4)))


def shape_of(mesh: TriangleMesh) -> Shape:
    """A mesh with both fields, laid out by x and y."""
    mesh = mesh.in_unit_cube()
    surface = surface_of(Chart(mesh, mesh.corners[..., :2]))
    points, starts = spread_points(surface, DIVISIONS)
    inner = inner_field(INNER, starts, [build_inner_rows(surface, INNER, points)])
    return Shape(surface, build_outer_field(surface, OUTER), inner)


@cache
def ball() -> Shape:
    return shape_of(sphere(96, 96))


@cache
def ring() -> Shape:
    return shape_of(torus(126, 63))


@cache
def body() -> Shape:
    """The bunny, or what stands in for it, upright."""
    return shape_of(load_mesh()[1])


@cache
def landscape(rows: int = 1024) -> np.ndarray:
    """Sky, a sun, hills, and a field of stripes: (rows, 2·rows, 3), an environment."""
    v, u = (np.mgrid[0:rows, 0 : 2 * rows] + 0.5) / rows
    angle, high = np.pi * u, 0.5 - v
    hills = 0.035 + 0.03 * np.sin(3 * angle) + 0.02 * np.sin(8 * angle + 1.0) + 0.008 * np.sin(21 * angle)
    far = hills + 0.04 + 0.02 * np.sin(5 * angle + 2.0)
    sky = np.stack([0.45 + 0.45 * (v / 0.5) ** 3, 0.62 + 0.28 * (v / 0.5) ** 3, 0.9 + 0.06 * v], axis=-1)
    picture = np.where((high < far)[..., None], [0.45, 0.55, 0.68], sky)
    woods = np.array([0.2, 0.38, 0.22]) * (0.8 + 0.4 * (np.sin(40 * angle) > 0))[..., None]
    picture = np.where((high < hills)[..., None], woods, picture)
    fields = np.where((np.sin(24 * angle) > 0)[..., None], [0.72, 0.62, 0.35], [0.5, 0.55, 0.25])
    picture = np.where(
        (high < 0.0)[..., None], fields * (0.6 + 0.4 * np.clip(1 + 2 * high, 0, 1))[..., None], picture
    )
    sun = np.hypot((u - 0.6) * np.cos(np.pi * high), high - 0.27) < 0.035
    return np.clip(np.where(sun[..., None], 1.0, picture), 0.0, 1.0)


def standing(x: float, y: float, size: float, turn_deg: float, material: Material) -> Instance:
    """The body on the ground, its y axis up, turned about the vertical."""
    turn = np.deg2rad(turn_deg)
    c, s = np.cos(turn), np.sin(turn)
    linear = (
        size
        * np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        @ placed((0, 0, 0), 1.0, UPRIGHT, 90.0)[:, :3]
    )
    lowest = (body().surface.triangles[:, [1, 4, 7]].min() - 0.5) * size
    shift = np.array([x, y, -lowest]) - linear @ np.full(3, 0.5)
    return Instance(body(), np.column_stack([linear, shift]), material)


def sphere_at(x: float, y: float, size: float, material: Material, lift: float = 0.0) -> Instance:
    """The ball on the ground or above it."""
    return Instance(ball(), placed((x, y, 0.5 * size + lift), size), material)


def camera_at(eye: tuple[float, float, float], to: tuple[float, float, float], degrees: float) -> Camera:
    return perspective(eye, to, (0.0, 0.0, 1.0), degrees)


def two_in_a_mirror() -> tuple[Scene, Camera]:
    """Figure 26, first row."""
    instances = (
        sphere_at(0.0, 0.5, 1.5, Material(colour=(0.9, 0.9, 0.95), mirror=0.9)),
        standing(-0.95, -0.5, 0.85, 150.0, Material(colour=CLAY)),
        standing(0.95, -0.5, 0.8, 220.0, Material(colour=RED)),
    )
    return Scene(instances, landscape(), GROUND), camera_at((0.0, -4.2, 1.7), (0.0, 0.0, 0.6), 40.0)


def in_a_ring() -> tuple[Scene, Camera]:
    """Figure 26, second row."""
    mirror = Material(colour=(0.9, 0.85, 0.7), mirror=0.85)
    instances = (
        Instance(ring(), placed((0.0, 0.3, 0.95), 1.9, (1.0, 0.15, 0.0), 75.0), mirror),
        standing(-0.1, -0.75, 0.6, 170.0, Material(colour=BLUE)),
        standing(0.0, 0.4, 0.5, 90.0, Material(colour=RED)),
    )
    return Scene(instances, landscape(), GROUND), camera_at((0.3, -3.6, 1.6), (0.0, 0.1, 0.75), 38.0)


def two_mirrors() -> tuple[Scene, Camera]:
    """Figure 26, third row."""
    instances = (
        sphere_at(-0.57, 0.1, 1.1, Material(colour=RED, mirror=0.7)),
        sphere_at(0.57, -0.15, 1.1, Material(colour=BLUE, mirror=0.7)),
    )
    return Scene(instances, landscape(), GROUND), camera_at((0.0, -3.4, 1.3), (0.0, 0.0, 0.5), 38.0)


def mirrored_body() -> tuple[Scene, Camera]:
    """Figure 26, last row."""
    instances = (
        sphere_at(0.62, 0.2, 1.2, Material(colour=(0.95, 0.95, 0.9), mirror=0.85)),
        standing(-0.6, -0.1, 1.1, 120.0, Material(colour=CLAY, mirror=0.5)),
    )
    return Scene(instances, landscape(), GROUND), camera_at((0.0, -3.6, 1.4), (0.05, 0.0, 0.6), 38.0)


def glass(shape: str, refraction: str) -> tuple[Scene, Camera]:
    """Figure 27, first and second row."""
    material = Material(colour=(0.9, 0.95, 1.0), glass=0.95, refraction=refraction)
    if shape == "ball":
        return Scene((sphere_at(0.0, 0.0, 1.2, material, 0.4),), landscape()), camera_at(
            (0, -3.2, 1.2), (0, 0, 1.0), 32.0
        )
    made = (standing(0.0, 0.0, 1.3, 160.0, material),)
    return Scene(made, landscape()), camera_at((0.0, -3.2, 0.9), (0.0, 0.0, 0.6), 32.0)


def self_reflection(itself: bool, others: bool) -> tuple[Scene, Camera]:
    """Figure 27, third row: of a body and a ball, with and without each other and themselves."""
    dark = np.full((2, 4, 3), 0.1)
    mirror = Material(colour=(0.95, 0.75, 0.5), mirror=0.55, self_reflection=itself)
    instances = [standing(-0.45, 0.0, 1.3, 150.0, mirror)]
    if others:
        instances.append(sphere_at(0.7, -0.45, 0.6, Material(colour=BLUE, mirror=0.4)))
    return Scene(tuple(instances), landscape() if others else dark), camera_at(
        (0, -3.2, 1.3), (0, 0, 0.6), 34.0
    )


SCENES: dict[str, Callable[[], tuple[Scene, Camera]]] = {
    "two instances in a mirror": two_in_a_mirror,
    "in a mirror ring": in_a_ring,
    "two mirrors": two_mirrors,
    "mirrored body and ball": mirrored_body,
    "ball refracting twice": lambda: glass("ball", "full"),
    "body refracting twice": lambda: glass("body", "full"),
    "self-reflection and others": lambda: self_reflection(True, True),
}

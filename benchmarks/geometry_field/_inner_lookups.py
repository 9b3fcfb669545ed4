"""Rays that leave the surface: the published inner field and ours against exact intersection."""

import time
from collections.abc import Iterable

import numpy as np

from bentray_kernels.arrays import Floats, Int32s
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.geometry_field.image.geometry_image import geometry_image
from bentray_kernels.geometry_field.layout.parameterisation import parameterise
from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from bentray_kernels.geometry_field.tables.reference_field import reference_field
from bentray_kernels.geometry_field.tracing.image_lookup import image_point
from bentray_kernels.geometry_field.tracing.lookup_scene import WAYS, from_the_surface
from bentray_kernels.geometry_field.tracing.packed_scene import World, world_of
from bentray_kernels.geometry_field.tracing.scene import Instance, Scene, Shape, placed
from bentray_kernels.meshes.intersector import WAITING
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_kernels.meshes.surface import Surface, surface_of
from bentray_service.cli.output.benchmark_row import Row

from ..shared._timing import alternate
from ._field_rays import build_outer_field, load_mesh

# The published ones, ours, and exact intersection.
COMPARED = {
    "uv-nearest": "published, nearest (u, v)",
    "uv-linear": "published, (u, v) of four exits",
    "walk": "ours, walk from the entry's face",
    "exact": "exact intersection",
}

# Samples along an edge of the cube for the outer field, which no ray that leaves the surface reads.
OUTER = 4

# Of the unit cube: farther from its place than this, a point is on another part of the surface.
FAR = 0.1


def world_with_fields(mesh: TriangleMesh, inner: int, divisions: int, pixels: int) -> World:
    """The mesh in its unit cube with all fields.

    Args:
        mesh: a closed one.
        inner: samples along an edge of the cube for the inner field.
        divisions: of the cube, for the points from which the inner field's rays start.
        pixels: along a side of the geometry image.
    """
    chart = parameterise(mesh).chart
    surface, image = surface_of(chart), geometry_image(chart, pixels)
    points, starts = spread_points(surface, divisions)
    within = inner_field(inner, starts, [build_inner_rows(surface, inner, points)])
    field = build_outer_field(surface, OUTER)
    reference = reference_field(surface, field, image.positions, image.normals, image.valid, (within, points))
    body = Instance(Shape(surface, field, within, reference), placed((0.5, 0.5, 0.5), 1.0))
    return world_of(Scene((body,), np.ones((2, 4, 3))))


def leaving_rays(surface: Surface, count: int, inside: bool) -> tuple[Int32s, Floats, Floats]:
    """Rays from anywhere on the surface, in any direction on one side of it.

    Args:
        surface: ``surface_of``.
        count: number of rays.
        inside: whether they run through the body.

    Returns:
        Faces that they leave, (rays,); origins and unit directions, (rays, 3), edges of the cube.
    """
    random = np.random.default_rng(int(inside))
    corners = surface.triangles[:, :9].reshape(-1, 3, 3).astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    faces = random.choice(len(area), count, p=area / area.sum())
    origins = (random.dirichlet(np.ones(3), count)[:, :, None] * corners[faces]).sum(axis=1)
    directions = random.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    out = (directions * normals[faces]).sum(axis=1) > 0.0
    directions[out == inside] *= -1.0
    return faces.astype(np.int32), origins, directions


@kernel
def next_points(
    world: World, way: int, side: float, faces: Int32s, origins: Floats, directions: Floats, points: Floats
) -> None:
    """Where rays that leave the first shape's surface meet it again.

    Args:
        world: of one instance, whose cube is the unit cube.
        way: of ``WAYS``.
        side: 1 for rays outside the body, −1 inside.
        faces: (rays,) that they leave.
        origins, directions: (rays, 3).
        points: (rays, 3), filled; NaN where they meet nothing.
    """
    waiting = np.empty(WAITING, dtype=np.int32)
    for r in range(len(faces)):
        origin = (origins[r, 0], origins[r, 1], origins[r, 2])
        direction = (directions[r, 0], directions[r, 1], directions[r, 2])
        face, distance, u, v, on_image = from_the_surface(
            world, 0, way, waiting, origin, direction, faces[r], side
        )
        for axis in range(3):
            points[r, axis] = origin[axis] + distance * direction[axis] if face >= 0 else np.nan
        if on_image:
            points[r, 0], points[r, 1], points[r, 2] = image_point(world, 0, u, v)


def found_points(world: World, way: str, inside: bool, rays: tuple[Int32s, Floats, Floats]) -> Floats:
    """(rays, 3) where ``leaving_rays`` meet the surface again, by one of ``WAYS``; NaN for nothing."""
    points = np.empty((len(rays[0]), 3))
    next_points(world, WAYS[way], -1.0 if inside else 1.0, *rays, points)
    return points


def inner_rows(quick: bool) -> Iterable[Row]:
    """Error, wrong hits and time of rays inside and outside the body, by each way."""
    name, mesh = load_mesh()
    inner, divisions, pixels = (8, 8, 129) if quick else (16, 16, 513)
    world = world_with_fields(mesh, inner, divisions, pixels)
    points = len(world.inner_faces) // (6 * inner**2)
    of = f"{name}, n = {inner}, {points} points, image {pixels}²"
    for inside in (True, False):
        rays = leaving_rays(world.surface, 20_000 if quick else 200_000, inside)
        yield from _compared(world, inside, rays, of)


def _compared(world: World, inside: bool, rays: tuple[Int32s, Floats, Floats], of: str) -> Iterable[Row]:
    label, count = f"Inner field, {'inside' if inside else 'outside'}", len(rays[0])
    runs = {way: lambda way=way: found_points(world, way, inside, rays) for way in COMPARED}
    exact = runs["exact"]()
    hit = np.isfinite(exact[:, 0])
    ns = {way: 1e9 * least / count for way, least in alternate(runs, 9, time.process_time).items()}
    speeds = ", ".join(f"{way} {least:.0f}" for way, least in ns.items())
    for way in list(COMPARED)[:-1]:
        points, words = runs[way](), COMPARED[way]
        met = np.isfinite(points[:, 0])
        off = np.linalg.norm(points - exact, axis=1)[met & hit]
        far = 100.0 * float((off > FAR).mean())
        detail = f"{words}; edges of the cube; mean {off.mean():.2g}, farther than {FAR}: {far:.2f} %; {of}"
        goal = 1e-3 if way == "walk" else 0.02
        yield Row(f"{label}, {way}, median error", float(np.median(off)), goal, "<=", "", detail)
        wrong = 100.0 * float((met != hit).mean())
        detail = f"{words}; {count} rays, {100.0 * hit.mean():.0f} % of which meet the surface again"
        yield Row(f"{label}, {way}, wrong hit or miss", wrong, 2.1, "<=", "%", detail)
        detail = f"ns a ray, one core: {speeds}"
        yield Row(f"{label}, {way}, speed over exact", ns["exact"] / ns[way], 1.0, ">=", "", detail)

"""Hits read from the geometry image at the (u, v) of both fields: the tracer of the dissertation.

Section 5.3.2: the (u, v) of the entries is looked up in the geometry image, which gives position and normal
of the hit. The next ray starts at that position, which is not exactly on the ray.
"""

import numpy as np

from ...arrays import Vector
from ...compilation.compiled import kernel
from ..tables.cube import number_at
from ..tables.quadrilinear import corner_of, nearest_of
from ..tables.reference_field import image_at, linear_uv_at
from ..tables.reference_inner_field import linear_exit_uv
from .appearance import to_world_normal, transformed, uv_of
from .packed_scene import Hit, World

# Channels of the image.
POSITION, NORMAL = 0, 3


@kernel(inline="always")
def from_the_image(
    world: World,
    shape: int,
    linear: bool,
    origin: Vector,
    direction: Vector,
    entry: tuple[int, float, float],
    leaving: tuple[int, float, float],
) -> Hit:
    """The first point of a shape on a ray that comes from outside its cube.

    Args:
        world: ``world_of``.
        shape: which of its shapes; it has a reference field.
        linear: whether (u, v) is averaged over 16 entries; else that of the nearest entry.
        origin, direction: in the shape's unit cube.
        entry, leaving: face, x and y where the ray enters the cube and leaves it, see ``cube.line_of``.
    """
    n, pixels = world.shapes[shape, 1], world.references[shape, 2]
    table = world.uv[world.references[shape, 0] :]
    if linear:
        corner = corner_of(n, *entry, *leaving)
        place = nearest_of(n, corner)
        u, v = linear_uv_at(table, n, corner, place)
    else:
        place = number_at(*entry, n) * (6 * n * n) + number_at(*leaving, n)
        u, v = table[2 * place], table[2 * place + 1]
    # The face serves rays that leave it; positions are read from the image.
    face = world.faces[world.shapes[shape, 2] + place]
    none = (-1, np.inf, 0.0, 0.0, False)
    # NaN is not equal to itself.
    if face < 0 or u != u:
        return none
    x, y, z = image_at(world.images, world.references[shape, 1], pixels, u, v, POSITION)
    along = (x - origin[0]) * direction[0] + (y - origin[1]) * direction[1] + (z - origin[2]) * direction[2]
    square = direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2
    if x != x:
        return none
    return face, along / square, float(u), float(v), True


@kernel(inline="always")
def next_on_the_image(
    world: World,
    shape: int,
    linear: bool,
    origin: Vector,
    direction: Vector,
    left: int,
    leaving: tuple[int, float, float],
) -> Hit:
    """The next point of a shape on a ray that leaves it, by the published inner field.

    The recorded point is taken wherever it lies; its distance from the origin is its depth.

    Args:
        world: ``world_of``.
        shape: which of its shapes; its reference field has ``inner_uv``.
        linear: whether (u, v) is averaged over four exits; else that of the nearest one.
        origin, direction: in the shape's unit cube.
        left: the face that the ray leaves.
        leaving: face, x and y where the ray leaves the cube, see ``cube.line_of``.
    """
    n, pixels = world.shapes[shape, 3], world.references[shape, 2]
    first = world.starts[left] * (6 * n * n)
    place = number_at(*leaving, n)
    row = world.inner_uv[world.references[shape, 3] + 2 * first :]
    # The face serves the next ray; the position is read from the image.
    face = world.inner_faces[world.shapes[shape, 4] + first + place]
    none = (-1, np.inf, 0.0, 0.0, False)
    if face < 0:
        return none
    u, v = row[2 * place], row[2 * place + 1]
    if linear:
        u, v = linear_exit_uv(row, n, *leaving)
    x, y, z = image_at(world.images, world.references[shape, 1], pixels, u, v, POSITION)
    square = direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2
    away = (x - origin[0]) ** 2 + (y - origin[1]) ** 2 + (z - origin[2]) ** 2
    # Not true of NaN either.
    if not away > 0.0:
        return none
    return face, float(np.sqrt(away / square)), float(u), float(v), True


@kernel(inline="always")
def on_the_image(world: World, shape: int, hit: Hit) -> Hit:
    """This hit by its (u, v), where the image covers it."""
    face, distance, first, second, _ = hit
    if face < 0:
        return hit
    u, v = uv_of(world, face, first, second)
    start, pixels = world.references[shape, 1], world.references[shape, 2]
    x, _, _ = image_at(world.images, start, pixels, u, v, POSITION)
    return hit if x != x else (face, distance, u, v, True)


@kernel(inline="always")
def image_point(world: World, k: int, u: float, v: float) -> Vector:
    """Position of an instance at (u, v), m, in the world."""
    reference = world.references[world.instances[k, 0]]
    place = image_at(world.images, reference[1], reference[2], u, v, POSITION)
    return transformed(world.to_world[k], place, 1.0)


@kernel(inline="always")
def image_normal(world: World, k: int, u: float, v: float) -> Vector:
    """Unit normal of an instance at (u, v), outward, in the world."""
    reference = world.references[world.instances[k, 0]]
    return to_world_normal(world, k, image_at(world.images, reference[1], reference[2], u, v, NORMAL))

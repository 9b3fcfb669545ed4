"""Shading: normals, light and texture of surfaces, ground and environment."""

import math

from ...arrays import Floats, Vector
from ...compilation.compiled import kernel
from .packed_scene import World


@kernel(inline="always")
def unit(a: Vector) -> Vector:
    """The unit vector along another."""
    over = 1.0 / math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return (a[0] * over, a[1] * over, a[2] * over)


@kernel(inline="always")
def transformed(m: Floats, a: Vector, place: float) -> Vector:
    """A place, or with ``place`` 0 a direction, by an affine transform (3, 4)."""
    return (
        m[0, 0] * a[0] + m[0, 1] * a[1] + m[0, 2] * a[2] + place * m[0, 3],
        m[1, 0] * a[0] + m[1, 1] * a[1] + m[1, 2] * a[2] + place * m[1, 3],
        m[2, 0] * a[0] + m[2, 1] * a[1] + m[2, 2] * a[2] + place * m[2, 3],
    )


@kernel(inline="always")
def normal_at(world: World, k: int, face: int, first: float, second: float) -> Vector:
    """Unit normal outward, in the world."""
    n = world.surface.normals[face]
    third = 1.0 - first - second
    x = first * n[0, 0] + second * n[1, 0] + third * n[2, 0]
    y = first * n[0, 1] + second * n[1, 1] + third * n[2, 1]
    z = first * n[0, 2] + second * n[1, 2] + third * n[2, 2]
    return to_world_normal(world, k, (x, y, z))


@kernel(inline="always")
def to_world_normal(world: World, k: int, normal: Vector) -> Vector:
    """Unit normal in the world of a normal in the unit cube: by the inverse transposed transform."""
    x, y, z = normal
    m = world.to_local[k]
    return unit(
        (
            m[0, 0] * x + m[1, 0] * y + m[2, 0] * z,
            m[0, 1] * x + m[1, 1] * y + m[2, 1] * z,
            m[0, 2] * x + m[1, 2] * y + m[2, 2] * z,
        )
    )


@kernel(inline="always")
def uv_of(world: World, face: int, first: float, second: float) -> tuple[float, float]:
    """The (u, v) at weights of corners 0 and 1 of a face."""
    # The corners of one face lie on one side of every cut of the chart.
    uv, third = world.surface.uv[face], 1.0 - first - second
    u = first * uv[0, 0] + second * uv[1, 0] + third * uv[2, 0]
    v = first * uv[0, 1] + second * uv[1, 1] + third * uv[2, 1]
    return u, v


@kernel(inline="always")
def shading(world: World, k: int, u: float, v: float, normal: Vector) -> Vector:
    """The surface's own colour at (u, v), under the light."""
    light = world.light
    cosine = max(light[0] * normal[0] + light[1] * normal[1] + light[2] * normal[2], 0.0)
    shown = light[3] + (1.0 - light[3]) * cosine
    texture = world.instances[k, 1]
    if texture < 0:
        return shown * world.looks[k, 0], shown * world.looks[k, 1], shown * world.looks[k, 2]
    start, rows, columns = world.textures[texture, 0], world.textures[texture, 1], world.textures[texture, 2]
    i = min(max(int(v * rows), 0), rows - 1)
    j = min(max(int(u * columns), 0), columns - 1)
    at = start + 3 * (i * columns + j)
    return shown * world.pictures[at], shown * world.pictures[at + 1], shown * world.pictures[at + 2]


@kernel(inline="always")
def ground_at(world: World, point: Vector) -> Vector:
    """Colour of the ground at a point of it."""
    square = world.ground[1]
    odd = (math.floor(point[0] / square) + math.floor(point[1] / square)) & 1
    at = 2 + 3 * odd
    return world.ground[at], world.ground[at + 1], world.ground[at + 2]


@kernel(inline="always")
def sky_at(world: World, direction: Vector) -> Vector:
    """The environment between the middles of its pixels; columns go round, rows end at the poles."""
    rows, columns = world.sky.shape[0], world.sky.shape[1]
    x = math.atan2(direction[1], direction[0]) / (2.0 * math.pi) * columns - 0.5
    y = math.acos(min(max(direction[2], -1.0), 1.0)) / math.pi * rows - 0.5
    left, upper = math.floor(x), math.floor(y)
    t, w = x - left, y - upper
    j0, j1 = left % columns, (left + 1) % columns
    i0, i1 = min(max(upper, 0), rows - 1), min(max(upper + 1, 0), rows - 1)
    sky = world.sky
    return (
        (1 - w) * ((1 - t) * sky[i0, j0, 0] + t * sky[i0, j1, 0])
        + w * ((1 - t) * sky[i1, j0, 0] + t * sky[i1, j1, 0]),
        (1 - w) * ((1 - t) * sky[i0, j0, 1] + t * sky[i0, j1, 1])
        + w * ((1 - t) * sky[i1, j0, 1] + t * sky[i1, j1, 1]),
        (1 - w) * ((1 - t) * sky[i0, j0, 2] + t * sky[i0, j1, 2])
        + w * ((1 - t) * sky[i1, j0, 2] + t * sky[i1, j1, 2]),
    )

"""Recursive ray tracing of a scene with reflection, refraction and self-reflection, to any depth.

Dissertation, section 5.3.2. Its ``TraceRay`` is a loop here: one ray continues from each surface, and its
colour is weighted by the shares along the path, so that the weights of a pixel's colours sum to 1. At the
last depth the rest of the weight gets the environment.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from ...arrays import Floats, Int32s, Vector
from ...compilation.compiled import kernel
from ...errors import InvalidInput
from ...meshes.intersector import WAITING
from ...refraction.backdrop import Colours
from ...refraction.camera import Camera, affine
from ...refraction.optics import refracted
from .appearance import ground_at, normal_at, shading, sky_at, transformed, unit, uv_of
from .image_lookup import image_normal, image_point
from .lookup_scene import WAYS, from_outside, from_the_surface
from .packed_scene import SEES_ITSELF, SINGLE, World

# Rows of the image traced in one call.
TILE_ROWS = 16

# Numbers of what a ray meets besides instances.
NOTHING, GROUND = -1, -2

# The face that a ray leaves if its body is ignored from there.
UNSEEN = -2


@dataclass(frozen=True)
class TraceSettings:
    """Settings of a rendering.

    Attributes:
        rows, columns: pixels.
        depth: most surfaces at which a ray continues; the dissertation has 2.
        way: lookup method: "nearest", "linear", "plane", "walk"; "exact" without fields; "uv-nearest" and
            "uv-linear" as published, by (u, v) and the geometry image, for shapes with a reference field.
        eye: the same for the first surface.
        threads: number of threads for tiles of rows.

    Raises:
        InvalidInput: for a number out of range, or another name.
    """

    rows: int = 512
    columns: int = 512
    depth: int = 4
    way: str = "walk"
    eye: str = "exact"
    threads: int = 1

    def __post_init__(self) -> None:
        for name, least in (("rows", 1), ("columns", 1), ("depth", 0), ("threads", 1)):
            if getattr(self, name) < least:
                raise InvalidInput(name, getattr(self, name), f"a whole number >= {least}")
        for name in ("way", "eye"):
            if getattr(self, name) not in WAYS:
                raise InvalidInput(name, getattr(self, name), "one of " + ", ".join(WAYS))


def trace(
    world: World, camera: Camera, settings: TraceSettings, pause: Callable[[], None] = lambda: None
) -> Colours:
    """A picture, (rows, columns, 3) 8-bit RGB.

    Args:
        world: ``world_of`` a scene.
        camera: ``refraction.perspective`` or ``orthographic``.
        settings: the rest.
        pause: called before every tile, possibly in another thread; an exception ends the rendering.
    """
    image = np.empty((settings.rows, settings.columns, 3), dtype=np.uint8)
    views = camera.origin, camera.direction
    ways = WAYS[settings.eye], WAYS[settings.way]

    def tile(first: int) -> None:
        pause()
        own = image[first : first + TILE_ROWS]
        _trace_rows(world, *views, *ways, settings.depth, first, settings.rows, own)

    with ThreadPoolExecutor(settings.threads) as pool:
        list(pool.map(tile, range(0, settings.rows, TILE_ROWS)))
    return image


@kernel
def _trace_rows(
    world: World,
    origins: Floats,
    directions: Floats,
    eye: int,
    way: int,
    depth: int,
    first: int,
    rows: int,
    image: Colours,
) -> None:
    waiting = np.empty(WAITING, dtype=np.int32)
    columns = image.shape[1]
    for i in range(len(image)):
        for j in range(columns):
            u, v = (j + 0.5) / columns - 0.5, (first + i + 0.5) / rows - 0.5
            origin = affine(origins, u, v)
            direction = unit(affine(directions, u, v))
            colour = colour_of(world, waiting, origin, direction, eye, way, depth)
            for c in range(3):
                image[i, j, c] = np.uint8(min(max(255.0 * colour[c] + 0.5, 0.0), 255.0))


@kernel
def colour_of(
    world: World, waiting: Int32s, origin: Vector, direction: Vector, eye: int, way: int, depth: int
) -> Vector:
    """RGB at the end of a ray.

    Args:
        world: ``world_of``.
        waiting: traversal stack of the exact intersector.
        origin, direction: m and a unit vector, in the world.
        eye, way: lookup methods of the first ray, and of those after it.
        depth: most surfaces at which it continues.
    """
    red, green, blue, weight = 0.0, 0.0, 0.0, 1.0
    # The instance and face that the ray leaves; within which instance it is.
    own, left, within = NOTHING, -1, NOTHING
    for turn in range(depth + 1):
        lookup = eye if turn == 0 else way
        met, face, distance, first, second, on_image = _nearest(
            world, waiting, origin, direction, lookup, own, left, within
        )
        if met == NOTHING:
            break
        point = (
            origin[0] + distance * direction[0],
            origin[1] + distance * direction[1],
            origin[2] + distance * direction[2],
        )
        if met == GROUND:
            local = ground_at(world, point)
            return red + weight * local[0], green + weight * local[1], blue + weight * local[2]
        if on_image:
            u, v = first, second
            point, normal = image_point(world, met, u, v), image_normal(world, met, u, v)
        else:
            u, v = uv_of(world, face, first, second)
            normal = normal_at(world, met, face, first, second)
        mirror, glass = world.looks[met, 3], world.looks[met, 4]
        if within == NOTHING:
            local = shading(world, met, u, v, normal)
            share = weight * (1.0 - mirror - glass)
            red, green, blue = red + share * local[0], green + share * local[1], blue + share * local[2]
            weight *= mirror + glass
        if weight == 0.0:
            return red, green, blue
        origin, left = point, face
        if mirror > 0.0:
            direction = _mirrored(direction, normal)
            own = met
        else:
            index = world.looks[met, 5]
            bent, _, passed = refracted(direction, normal, 1.0 / index if within == NOTHING else index)
            direction = bent
            entered = passed == (within == NOTHING)
            if entered and world.instances[met, 2] & SINGLE:
                # Straight on from here: the other side of the body is not there.
                entered, left = False, UNSEEN
            own, within = met, met if entered else NOTHING
    sky = sky_at(world, direction)
    return red + weight * sky[0], green + weight * sky[1], blue + weight * sky[2]


@kernel(inline="always")
def _nearest(
    world: World,
    waiting: Int32s,
    origin: Vector,
    direction: Vector,
    way: int,
    own: int,
    left: int,
    within: int,
) -> tuple[int, int, float, float, float, bool]:
    """First hit of a ray: instance, ``GROUND`` or ``NOTHING``; then as ``Hit``, the distance in m."""
    met, face, distance, first, second, on_image = NOTHING, -1, np.inf, 0.0, 0.0, False
    for k in range(len(world.instances)):
        if within != NOTHING and k != within:
            continue
        if k == own and (left == UNSEEN or (within == NOTHING and not world.instances[k, 2] & SEES_ITSELF)):
            continue
        shape = world.instances[k, 0]
        m = world.to_local[k]
        o, d = transformed(m, origin, 1.0), transformed(m, direction, 0.0)
        if k == own:
            hit = from_the_surface(world, shape, way, waiting, o, d, left, 1.0 if within == NOTHING else -1.0)
        else:
            hit = from_outside(world, shape, way, waiting, o, d)
        if hit[0] >= 0 and hit[1] < distance:
            met, face, distance, first, second, on_image = k, hit[0], hit[1], hit[2], hit[3], hit[4]
    if world.ground[1] > 0.0 and within == NOTHING and direction[2] != 0.0:
        down = (world.ground[0] - origin[2]) / direction[2]
        x, y = origin[0] + down * direction[0], origin[1] + down * direction[1]
        if 1e-9 < down < distance and x * x + y * y <= world.ground[8] ** 2:
            met, distance = GROUND, down
    return met, face, distance, first, second, on_image


@kernel(inline="always")
def _mirrored(direction: Vector, normal: Vector) -> Vector:
    turn = -2.0 * (direction[0] * normal[0] + direction[1] * normal[1] + direction[2] * normal[2])
    return (
        direction[0] + turn * normal[0],
        direction[1] + turn * normal[1],
        direction[2] + turn * normal[2],
    )

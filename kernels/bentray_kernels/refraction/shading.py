"""Phong shading of the opaque surface, without refraction."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Vector
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from ..isosurface.crossing import MAX_HALVINGS, Search, leave_interval
from .backdrop import Colours
from .camera import Camera, ray_at
from .caster import (
    RefractiveMedium,
    gradient_at,
    in_nodes,
    layer_at,
    medium_of,
    through_box,
    unit_normal,
)
from .scene import Scene

# Rows of the image shaded in one call.
TILE_ROWS = 16


class Light(NamedTuple):
    """Phong's model (1975): ambient + diffuse·cos + specular·cosⁿ, with one light far away.

    Attributes:
        towards: unit vector from the object to the light.
        ambient, diffuse, specular: shares; without ``specular`` the model is Lambert's.
        shininess: n.
        colour: 8-bit RGB of the surface; highlights are white.
        background: 8-bit RGB where there is none.
    """

    towards: Vector
    ambient: float = 0.1
    diffuse: float = 0.7
    specular: float = 0.2
    shininess: float = 20.0
    colour: Vector = (220.0, 200.0, 160.0)
    background: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Shaded:
    """A shaded surface.

    Attributes:
        image: (rows, columns, 3) 8-bit RGB.
        normal: (rows, columns, 3) unit vectors towards lower values, NaN where there is no surface.
        distance_m: (rows, columns) along the ray, NaN where there is none.
    """

    image: Colours
    normal: Floats
    distance_m: Floats


def shade(
    scene: Scene,
    camera: Camera,
    light: Light,
    rows: int,
    columns: int,
    threads: int = 1,
    pause: Callable[[], None] = lambda: None,
) -> Shaded:
    """The first surface that each pixel's ray meets.

    Args:
        scene: ``Scene.build``; the refractive indices are not used.
        camera: of the image.
        light: light and surface properties.
        rows, columns: pixels, at least 1.
        threads: number of threads for tiles of rows.
        pause: called before every tile, possibly in another thread; an exception ends the rendering.

    Raises:
        InvalidInput: for no pixels.
    """
    if min(rows, columns) < 1:
        raise InvalidInput("rows, columns", (rows, columns), "whole numbers >= 1")
    image = np.empty((rows, columns, 3), dtype=np.uint8)
    normal, distance = np.full((rows, columns, 3), np.nan), np.full((rows, columns), np.nan)
    medium, search = medium_of(scene, "octree"), scene.search()
    rays = camera.origin, camera.direction

    def tile(first: int) -> None:
        pause()
        own = slice(first, first + TILE_ROWS)
        _shade(medium, search, rays, light, first, rows, image[own], normal[own], distance[own])

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(tile, range(0, rows, TILE_ROWS)))
    return Shaded(image, normal, distance)


@kernel
def _shade(
    medium: RefractiveMedium,
    search: Search,
    camera: tuple[Floats, Floats],
    light: Light,
    first: int,
    rows: int,
    image: Colours,
    normals: Floats,
    distances: Floats,
) -> None:
    columns = distances.shape[1]
    for i in range(len(distances)):
        for j in range(columns):
            u, v = (j + 0.5) / columns - 0.5, (first + i + 0.5) / rows - 0.5
            origin, direction = ray_at(camera, u, v)
            ray = in_nodes(medium, origin, direction)
            near, far, _, _ = through_box(ray, medium.low, medium.high)
            near = max(near, 0.0)
            image[i, j, 0], image[i, j, 1], image[i, j, 2] = light.background
            if not far > near:
                continue
            layer = layer_at(medium, ray, near)
            s, side, gradient, _ = leave_interval(
                medium.field,
                medium.octree,
                search,
                ray,
                near,
                far,
                medium.levels[layer],
                medium.levels[layer + 1],
                (1 << layer) | (1 << layer >> 1),
                0.0,
                MAX_HALVINGS,
            )
            if side == 0:
                continue
            gradient = gradient_at(medium, ray, s, gradient)
            normal = unit_normal((-gradient[0], -gradient[1], -gradient[2]), direction)
            distances[i, j] = s
            normals[i, j, 0], normals[i, j, 1], normals[i, j, 2] = normal
            _paint(image, i, j, light, normal, direction)


@kernel(inline="always")
def _paint(image: Colours, i: int, j: int, light: Light, normal: Vector, direction: Vector) -> None:
    along = direction[0] * normal[0] + direction[1] * normal[1] + direction[2] * normal[2]
    # The side that is seen is lit, whichever way values fall.
    facing = -1.0 if along > 0.0 else 1.0
    towards = light.towards
    cosine = facing * (towards[0] * normal[0] + towards[1] * normal[1] + towards[2] * normal[2])
    diffuse, specular = 0.0, 0.0
    if cosine > 0.0:
        mirrored = 2.0 * along * facing * cosine - (
            direction[0] * towards[0] + direction[1] * towards[1] + direction[2] * towards[2]
        )
        diffuse = light.diffuse * cosine
        specular = light.specular * max(-mirrored, 0.0) ** light.shininess if light.specular > 0.0 else 0.0
    for c in range(3):
        colour = light.colour[c] * (light.ambient + diffuse) + 255.0 * specular
        image[i, j, c] = np.uint8(min(colour + 0.5, 255.0))

"""The ray caster: from the camera through all interfaces to the backdrop, a block of rays a call."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compiled import kernel
from ..isosurface.crossing import Search, leave_interval
from ..isosurface.octree import Octree
from ..isosurface.roots import Field, Ray, field_at, point_at
from ..splines.sampling import value_and_gradient_at
from .optics import Vector, refracted
from .scene import Scene

# What became of a ray: it met nothing; it was refracted; it did not leave within the depth limit.
MISSED, REFRACTED, LOST = 0, 1, 2


class Medium(NamedTuple):
    """A scene as the compiled functions read it.

    Attributes:
        field, octree: as in ``Scene``.
        levels: (isos + 2,) −∞, the iso-values, +∞: layer m lies between m and m + 1.
        indices: (isos + 1,) refractive indices of the layers.
        origin: of node 0, m.
        spacing: m.
        last: index of the last node along each axis.
    """

    field: Field
    octree: Octree
    levels: Floats
    indices: Floats
    origin: Vector
    spacing: Vector
    last: Vector


def medium_of(scene: Scene) -> Medium:
    """The scene for the compiled functions."""
    levels = np.array([-np.inf, *scene.layers.isos, np.inf])
    x, y, z = (float(p) for p in scene.origin)
    dx, dy, dz = (float(p) for p in scene.spacing)
    nx, ny, nz = (float(n - 1) for n in scene.shape)
    indices = np.array(scene.layers.indices)
    return Medium(scene.field, scene.octree, levels, indices, (x, y, z), (dx, dy, dz), (nx, ny, nz))


class Traced(NamedTuple):
    """What the caster says of n rays.

    Attributes:
        point: (n, 3) a place on the ray when it left, m.
        direction: (n, 3) its direction then, unit vectors.
        fate: (n,) ``MISSED``, ``REFRACTED`` or ``LOST``.
        crossed: (n,) interfaces that it met.
        weight: (n,) share of unpolarised energy that took this path.
        vertices: (n, depth + 1, 3) where it met them, m; (0, 0, 3) if the paths are not asked for.
    """

    point: Floats
    direction: Floats
    fate: NDArray[np.uint8]
    crossed: NDArray[np.int16]
    weight: Floats
    vertices: Floats


def space_for(rays: int, depth: int, paths: bool) -> Traced:
    """Arrays for the caster to fill."""
    return Traced(
        np.empty((rays, 3)),
        np.empty((rays, 3)),
        np.empty(rays, dtype=np.uint8),
        np.empty(rays, dtype=np.int16),
        np.empty(rays),
        np.full((rays, depth + 1, 3) if paths else (0, 0, 3), np.nan),
    )


@kernel
def cast(
    medium: Medium,
    search: Search,
    camera: tuple[Floats, Floats],
    places: Floats,
    depth: int,
    traced: Traced,
) -> None:
    """Follow rays through the medium.

    Args:
        medium: the scene.
        search: how crossings are found.
        camera: ``Camera.origin`` and ``Camera.direction``.
        places: (n, 2) u and v of the rays in the image, from −½ to ½.
        depth: most interfaces that a ray may meet.
        traced: filled in.
    """
    origin, direction = camera
    for n in range(len(places)):
        start = _affine(origin, places[n, 0], places[n, 1])
        ahead = _affine(direction, places[n, 0], places[n, 1])
        length = math.sqrt(ahead[0] ** 2 + ahead[1] ** 2 + ahead[2] ** 2)
        ahead = (ahead[0] / length, ahead[1] / length, ahead[2] / length)
        _follow(medium, search, start, ahead, depth, traced, n)


@kernel(inline="always")
def _affine(basis: Floats, u: float, v: float) -> Vector:
    return (
        basis[0, 0] + u * basis[1, 0] + v * basis[2, 0],
        basis[0, 1] + u * basis[1, 1] + v * basis[2, 1],
        basis[0, 2] + u * basis[1, 2] + v * basis[2, 2],
    )


@kernel(inline="always")
def _follow(
    medium: Medium, search: Search, origin: Vector, direction: Vector, depth: int, traced: Traced, n: int
) -> None:
    layers = len(medium.indices)
    crossed, weight = 0, 1.0
    layer, entered, slope = 0, False, 0.0
    fate = MISSED
    while True:
        ray = _in_nodes(medium, origin, direction)
        near, far, face_in, face_out = _box(ray, medium.last)
        start = 0.0 if entered else max(near, 0.0)
        if not entered:
            if not far > start:
                break
            entered = True
            value = field_at(medium.field, ray, start)
            while layer + 1 < layers and value > medium.levels[layer + 1]:
                layer += 1
            if layer == 0 or near < 0.0:
                # Outside the object, or the camera itself is within the volume.
                pass
            else:
                # The object is cut by the volume's box: that face is flat.
                origin = _moved(origin, direction, start)
                ratio = medium.indices[0] / medium.indices[layer]
                direction, share, passed = refracted(direction, _axis(face_in), ratio)
                weight, crossed, fate = weight * share, crossed + 1, REFRACTED
                _note(traced, n, crossed, origin)
                if not passed:
                    break
                continue
        s, side = leave_interval(
            medium.field,
            medium.octree,
            search,
            ray,
            start,
            far,
            medium.levels[layer],
            medium.levels[layer + 1],
            slope,
        )
        if side == 0 and layer == 0:
            break
        if crossed == depth:
            fate = LOST
            break
        origin = _moved(origin, direction, s)
        if side == 0:
            normal, behind = _axis(face_out), 0
            gradient = (0.0, 0.0, 0.0)
        else:
            _, gradient = value_and_gradient_at(
                medium.field.coefficients, medium.field.stencil, point_at(ray, s)
            )
            normal, behind = _unit_normal(gradient, medium.spacing), layer + side
        ratio = medium.indices[layer] / medium.indices[behind]
        direction, share, passed = refracted(direction, normal, ratio)
        weight, crossed, fate = weight * share, crossed + 1, REFRACTED
        _note(traced, n, crossed, origin)
        if passed:
            layer = behind
            if side == 0:
                break
        slope = (
            gradient[0] * direction[0] / medium.spacing[0]
            + gradient[1] * direction[1] / medium.spacing[1]
            + gradient[2] * direction[2] / medium.spacing[2]
        )
    traced.point[n, 0], traced.point[n, 1], traced.point[n, 2] = origin
    traced.direction[n, 0], traced.direction[n, 1], traced.direction[n, 2] = direction
    traced.fate[n], traced.crossed[n], traced.weight[n] = fate, crossed, weight


@kernel(inline="always")
def _in_nodes(medium: Medium, origin: Vector, direction: Vector) -> Ray:
    return Ray(
        (origin[0] - medium.origin[0]) / medium.spacing[0],
        (origin[1] - medium.origin[1]) / medium.spacing[1],
        (origin[2] - medium.origin[2]) / medium.spacing[2],
        direction[0] / medium.spacing[0],
        direction[1] / medium.spacing[1],
        direction[2] / medium.spacing[2],
    )


@kernel(inline="always")
def _box(ray: Ray, last: Vector) -> tuple[float, float, int, int]:
    """s where the ray enters and leaves the grid, and the axes of these faces; far < near where it misses."""
    near, far, face_in, face_out = -math.inf, math.inf, 0, 0
    starts, alongs = (ray.x, ray.y, ray.z), (ray.along_x, ray.along_y, ray.along_z)
    for axis in range(3):
        start, along = starts[axis], alongs[axis]
        if along == 0.0:
            if not 0.0 <= start <= last[axis]:
                far = -math.inf
            continue
        a, b = -start / along, (last[axis] - start) / along
        if min(a, b) > near:
            near, face_in = min(a, b), axis
        if max(a, b) < far:
            far, face_out = max(a, b), axis
    return near, far, face_in, face_out


@kernel(inline="always")
def _axis(axis: int) -> Vector:
    return (
        1.0 if axis == 0 else 0.0,
        1.0 if axis == 1 else 0.0,
        1.0 if axis == 2 else 0.0,
    )


@kernel(inline="always")
def _unit_normal(gradient: Vector, spacing: Vector) -> Vector:
    x, y, z = gradient[0] / spacing[0], gradient[1] / spacing[1], gradient[2] / spacing[2]
    length = math.sqrt(x * x + y * y + z * z)
    # A surface without a gradient, at a singular point, has no normal: the ray goes straight on.
    return (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, 0.0)


@kernel(inline="always")
def _moved(origin: Vector, direction: Vector, s: float) -> Vector:
    return origin[0] + s * direction[0], origin[1] + s * direction[1], origin[2] + s * direction[2]


@kernel(inline="always")
def _note(traced: Traced, n: int, crossed: int, place: Vector) -> None:
    if crossed <= traced.vertices.shape[1]:
        traced.vertices[n, crossed - 1, 0] = place[0]
        traced.vertices[n, crossed - 1, 1] = place[1]
        traced.vertices[n, crossed - 1, 2] = place[2]

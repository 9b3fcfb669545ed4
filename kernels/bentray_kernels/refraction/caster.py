"""The ray caster: from the camera through all interfaces to the backdrop, one block of rays per call."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Vector
from ..compilation.compiled import kernel
from ..isosurface.crossing import MAX_HALVINGS, Search, leave_interval
from ..isosurface.octree import Octree
from ..isosurface.roots import Ray, field_at, point_at, ray_of
from ..splines.sampler import Sampler, sampled_value_and_gradient, sampler_of
from .camera import ray_at
from .optics import refracted
from .scene import Scene

# Fate of a ray: no interface; refracted; not left within the depth limit, or so close to an iso-surface that
# the search for crossings was ended.
MISSED, REFRACTED, LOST = 0, 1, 2


class RefractiveMedium(NamedTuple):
    """A scene for compiled functions.

    Attributes:
        field: the sampler of ``Scene.field``.
        octree: as in ``Scene``.
        levels: (isos + 2,) −∞, the iso-values, +∞: layer m lies between m and m + 1.
        indices: (isos + 1,) refractive indices of the layers.
        around: the layer around the grid.
        origin: of node 0, m.
        density: nodes per m along each axis.
        low, high: corners of the box that holds all surfaces, nodes.
        open: whether the box is the grid itself, whose faces then cut the object.
    """

    field: Sampler
    octree: Octree
    levels: Floats
    indices: Floats
    around: int
    origin: Vector
    density: Vector
    low: Vector
    high: Vector
    open: bool


def medium_of(scene: Scene, structure: str) -> RefractiveMedium:
    """The scene for the compiled functions; the DDA and steps traverse the whole grid, as published."""
    boxed = structure == "octree"
    low, high = scene.box if boxed else scene.grid
    levels = np.array([-np.inf, *scene.layers.isos, np.inf])
    return RefractiveMedium(
        sampler_of(scene.field),
        scene.octree,
        levels,
        np.array(scene.layers.indices),
        scene.layers.surroundings,
        _vector(scene.origin),
        _vector(1.0 / scene.spacing),
        _vector(low),
        _vector(high),
        scene.open or not boxed,
    )


def _vector(numbers: Floats) -> Vector:
    x, y, z = (float(number) for number in numbers)
    return x, y, z


class Traced(NamedTuple):
    """Results of the caster for n rays.

    Attributes:
        point: (n, 3) a point of the outgoing ray, m.
        direction: (n, 3) its direction, unit vectors.
        fate: (n,) ``MISSED``, ``REFRACTED`` or ``LOST``.
        crossed: (n,) number of interfaces.
        weight: (n,) share of unpolarised energy on this path.
    """

    point: Floats
    direction: Floats
    fate: NDArray[np.uint8]
    crossed: NDArray[np.int16]
    weight: Floats

    def part(self, rays: slice) -> Traced:
        """A view of some of the rays."""
        every: tuple[Any, ...] = self
        return Traced(*(array[rays] for array in every))


def allocate_results(rays: int) -> Traced:
    """Allocate the results of the caster."""
    return Traced(
        np.empty((rays, 3)),
        np.empty((rays, 3)),
        np.empty(rays, dtype=np.uint8),
        np.empty(rays, dtype=np.int16),
        np.empty(rays),
    )


@kernel
def cast(
    medium: RefractiveMedium,
    search: Search,
    camera: tuple[Floats, Floats],
    places: Floats,
    depth: int,
    traced: Traced,
) -> None:
    """Trace rays through the medium.

    Args:
        medium: the scene.
        search: how crossings are found.
        camera: ``Camera.origin`` and ``Camera.direction``.
        places: (n, 2) u and v of the rays in the image, from −½ to ½.
        depth: most interfaces that a ray may meet.
        traced: filled in.
    """
    for n in range(len(places)):
        start, ahead = ray_at(camera, places[n, 0], places[n, 1])
        _trace_ray(medium, search, start, ahead, depth, traced, n)


@kernel(inline="always")
def _trace_ray(
    medium: RefractiveMedium,
    search: Search,
    origin: Vector,
    direction: Vector,
    depth: int,
    traced: Traced,
    n: int,
) -> None:
    crossed, weight = 0, 1.0
    layer, entered, slope = 0, False, 0.0
    halvings = MAX_HALVINGS
    fate = MISSED
    while True:
        ray = in_nodes(medium, origin, direction)
        near, far, face_in, face_out = through_box(ray, medium.low, medium.high)
        start = 0.0 if entered else max(near, 0.0)
        if not entered:
            if not far > start:
                break
            entered = True
            layer = layer_at(medium, ray, start)
            if layer != medium.around and near >= 0.0:
                # The object is cut by the grid's face, which is flat. (A camera within the grid meets no
                # face.)
                origin = _point_at(origin, direction, start)
                ratio = medium.indices[medium.around] / medium.indices[layer]
                direction, share, passed = refracted(direction, _axis(face_in), ratio)
                weight, crossed, fate = weight * share, crossed + 1, REFRACTED
                if not passed:
                    break
                continue
        s, side, gradient, halvings = leave_interval(
            medium.field,
            medium.octree,
            search,
            ray,
            start,
            far,
            medium.levels[layer],
            medium.levels[layer + 1],
            # Iso-value m − 1 lies below layer m, iso-value m above it.
            (1 << layer) | (1 << layer >> 1),
            slope,
            halvings,
        )
        if side == 0 and halvings >= 0 and layer == medium.around:
            break
        if crossed == depth or halvings < 0:
            fate = LOST
            break
        origin = _point_at(origin, direction, s)
        if side == 0:
            normal, behind = _axis(face_out), medium.around
            gradient = (0.0, 0.0, 0.0)
        else:
            gradient = gradient_at(medium, ray, s, gradient)
            normal, behind = unit_normal(gradient, direction), layer + side
        ratio = medium.indices[layer] / medium.indices[behind]
        direction, share, passed = refracted(direction, normal, ratio)
        weight, crossed, fate = weight * share, crossed + 1, REFRACTED
        if passed:
            layer = behind
            if side == 0:
                break
        slope = gradient[0] * direction[0] + gradient[1] * direction[1] + gradient[2] * direction[2]
    traced.point[n, 0], traced.point[n, 1], traced.point[n, 2] = origin
    traced.direction[n, 0], traced.direction[n, 1], traced.direction[n, 2] = direction
    traced.fate[n], traced.crossed[n], traced.weight[n] = fate, crossed, weight


@kernel(inline="always")
def layer_at(medium: RefractiveMedium, ray: Ray, s: float) -> int:
    """The layer at the start of a ray, at the box or within it."""
    layer = medium.around
    # On the faces of a box within the grid lies that of the surroundings, and most rays begin there.
    if medium.open or s == 0.0:
        layer = 0
        value = field_at(medium.field, ray, s)
        while layer + 1 < len(medium.indices) and value > medium.levels[layer + 1]:
            layer += 1
    return layer


@kernel(inline="always")
def in_nodes(medium: RefractiveMedium, origin: Vector, direction: Vector) -> Ray:
    x, y, z = medium.density
    place = (
        (origin[0] - medium.origin[0]) * x,
        (origin[1] - medium.origin[1]) * y,
        (origin[2] - medium.origin[2]) * z,
    )
    return ray_of(place, (direction[0] * x, direction[1] * y, direction[2] * z))


@kernel(inline="always")
def through_box(ray: Ray, low: Vector, high: Vector) -> tuple[float, float, int, int]:
    """s where the ray enters and leaves a box, and the axes of these faces; far < near where it misses."""
    near, far, face_in, face_out = -math.inf, math.inf, 0, 0
    starts, overs = (ray.x, ray.y, ray.z), (ray.over_x, ray.over_y, ray.over_z)
    for axis in range(3):
        if math.isinf(overs[axis]):
            if not low[axis] <= starts[axis] <= high[axis]:
                far = -math.inf
            continue
        a, b = (low[axis] - starts[axis]) * overs[axis], (high[axis] - starts[axis]) * overs[axis]
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
def gradient_at(medium: RefractiveMedium, ray: Ray, s: float, known: Vector) -> Vector:
    """Gradient of the field at s, per m; read there unless it is known per node, not NaN."""
    slopes = known
    if math.isnan(known[0]):
        _, slopes = sampled_value_and_gradient(medium.field, point_at(ray, s))
    x, y, z = medium.density
    return slopes[0] * x, slopes[1] * y, slopes[2] * z


@kernel(inline="always")
def unit_normal(gradient: Vector, direction: Vector) -> Vector:
    """Unit vector along the gradient; at singular points the direction, without refraction."""
    square = gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2]
    if square == 0.0:
        return direction
    over = 1.0 / math.sqrt(square)
    return gradient[0] * over, gradient[1] * over, gradient[2] * over


@kernel(inline="always")
def _point_at(origin: Vector, direction: Vector, s: float) -> Vector:
    return origin[0] + s * direction[0], origin[1] + s * direction[1], origin[2] + s * direction[2]

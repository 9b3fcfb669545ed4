"""The first hit of a ray on one shape, from its fields or by exact intersection."""

import numpy as np

from ...arrays import Int32s, Vector
from ...compilation.compiled import int64, kernel
from ...meshes.face_plane import meet_plane
from ...meshes.intersector import closest
from ..tables.accurate_lookup import STEPS, settle
from ..tables.agreement import AGREE
from ..tables.cube import line_of, number_at
from ..tables.outer_field import boundary_face
from ..tables.quadrilinear import corner_of, lerp4
from .image_lookup import from_the_image, next_on_the_image, on_the_image
from .packed_scene import Hit, World

# Lookup methods: distance of the entry nearest to the ray; the same, averaged where the entries around the
# ray agree; the plane of its face; a walk from its face; exact intersection without a field. As published:
# the (u, v) of the nearest entry, or averaged over 16, and the geometry image there.
NEAREST, LINEAR, PLANE, WALK, EXACT, UV_NEAREST, UV_LINEAR = 0, 1, 2, 3, 4, 5, 6
FACE_WAYS = {"nearest": NEAREST, "linear": LINEAR, "plane": PLANE, "walk": WALK, "exact": EXACT}
UV_WAYS = {"uv-nearest": UV_NEAREST, "uv-linear": UV_LINEAR}
WAYS = FACE_WAYS | UV_WAYS

# A ray that leaves the surface meets it again at this distance or later, edges of the unit cube.
MIN_DISTANCE = 1e-6


@kernel
def intersect_exactly(
    world: World, shape: int, waiting: Int32s, origin: Vector, direction: Vector, left: int
) -> Hit:
    """The first face of a shape by the exact intersector; ``left`` is the face that the ray leaves, or −1."""
    length = (direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2) ** 0.5
    begin = MIN_DISTANCE / length if left >= 0 else 0.0
    root = world.shapes[shape, 0]
    face, distance, first, second, _ = closest(
        world.surface, waiting, root, origin, direction, begin, np.inf, left
    )
    return face, distance, first, second, False


@kernel(inline="always")
def from_outside(
    world: World, shape: int, way: int, waiting: Int32s, origin: Vector, direction: Vector
) -> Hit:
    """The first face of a shape on a ray that leaves another one, or the eye.

    Args:
        world: ``world_of``.
        shape: which of its shapes.
        way: of ``WAYS``.
        waiting: traversal stack of the exact intersector.
        origin, direction: in the shape's unit cube.
    """
    none = (-1, np.inf, 0.0, 0.0, False)
    near, far, s, sx, sy, t, tx, ty = line_of(*origin, *direction)
    if not (near < far and far > 0.0):
        return none
    n, start = world.shapes[shape, 1], world.shapes[shape, 2]
    if way > EXACT and world.references[shape, 2] > 0:
        linear = way == UV_LINEAR
        hit = from_the_image(world, shape, linear, origin, direction, (s, sx, sy), (t, tx, ty))
        if hit[1] < 0.0:
            hit = intersect_exactly(world, shape, waiting, origin, direction, -1)
            hit = on_the_image(world, shape, hit)
        return hit
    if way >= EXACT or n == 0:
        return intersect_exactly(world, shape, waiting, origin, direction, -1)
    place = start + number_at(s, sx, sy, n) * (6 * n * n) + number_at(t, tx, ty, n)
    face = world.faces[place] if way != WALK else boundary_face(world.faces[place])
    if face < 0:
        return none
    length = far - near
    at = (origin[0] + near * direction[0], origin[1] + near * direction[1], origin[2] + near * direction[2])
    if way == WALK:
        face, distance, first, second = settle(world.surface, face, 1.0, STEPS, *at, *direction)
        distance = min(max(distance, 0.0), length)
        if face < 0:
            return none
    else:
        plane, first, second, _, _ = meet_plane(world.surface.triangles, face, *at, *direction)
        distance = world.fractions[place] * length
        if way == PLANE and 0.0 <= plane <= length:
            distance = plane
        corner = corner_of(n, s, sx, sy, t, tx, ty)
        if way == LINEAR and world.known[start + corner[0]] == AGREE:
            distance = length * lerp4(world.fractions[start:], n, corner, 1, 0)
        first, second = inside(first, second)
    if near + distance < 0.0:
        # The ray starts within the cube, behind what the entry meets first.
        return intersect_exactly(world, shape, waiting, origin, direction, -1)
    return face, near + distance, first, second, False


@kernel(inline="always")
def from_the_surface(
    world: World,
    shape: int,
    way: int,
    waiting: Int32s,
    origin: Vector,
    direction: Vector,
    left: int,
    side: float,
) -> Hit:
    """The next face of the same shape on a ray that leaves one of its faces.

    Args:
        world, shape, way, waiting: as in ``from_outside``; those of (u, v) read the published inner field,
            and any other way but "exact" walks from the entry's face, since a ray that starts on the surface
            has no room for the error of the other ways. Without a published inner field those of (u, v) walk
            too, and then read the geometry image.
        origin, direction: in the shape's unit cube.
        left: the face that the ray leaves.
        side: 1 for rays outside the body, −1 inside.
    """
    published = way > EXACT and world.references[shape, 2] > 0
    if published and world.references[shape, 3] >= 0:
        _, _, _, _, _, t, tx, ty = line_of(*origin, *direction)
        linear = way == UV_LINEAR
        return next_on_the_image(world, shape, linear, origin, direction, left, (t, tx, ty))
    known = EXACT if way > EXACT and not published else way
    hit = _next_face(world, shape, known, waiting, origin, direction, left, side)
    return on_the_image(world, shape, hit) if published else hit


@kernel(inline="always")
def _next_face(
    world: World,
    shape: int,
    way: int,
    waiting: Int32s,
    origin: Vector,
    direction: Vector,
    left: int,
    side: float,
) -> Hit:
    """Like ``from_the_surface``, by the weights of the corners."""
    n, start = world.shapes[shape, 3], world.shapes[shape, 4]
    if way == EXACT or n == 0:
        return intersect_exactly(world, shape, waiting, origin, direction, left)
    _, _, _, _, _, t, tx, ty = line_of(*origin, *direction)
    face = int64(world.inner_faces[start + world.starts[left] * (6 * n * n) + number_at(t, tx, ty, n)])
    if face >= 0:
        face, distance, first, second = settle(world.surface, face, side, STEPS, *origin, *direction)
        length = (direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2) ** 0.5
        if face >= 0 and face != left and distance * length > MIN_DISTANCE:
            return face, distance, first, second, False
    if side < 0.0:
        # A ray inside a body meets it somewhere: the entry was one of a ray that passed a fold.
        return intersect_exactly(world, shape, waiting, origin, direction, left)
    return -1, np.inf, 0.0, 0.0, False


@kernel(inline="always")
def inside(first: float, second: float) -> tuple[float, float]:
    """Weights of corners 0 and 1 of the point of a triangle close to one in its plane."""
    first, second = max(first, 0.0), max(second, 0.0)
    third = max(1.0 - first - second, 0.0)
    total = first + second + third
    return first / total, second / total

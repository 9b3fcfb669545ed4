"""Exact, watertight ray-triangle intersection with a bounding volume hierarchy.

Corners are sheared into a plane across the ray, in which the ray is the point 0 (Woop, Benthin and Wald,
Watertight ray/triangle intersection, 2013). On which side of it an edge passes is the sign of a difference of
two products, which rounding may turn to 0 but not around; so no ray slips between two faces.
"""

import numpy as np
from numpy.typing import NDArray

from ..arrays import Float32s, Floats, Int32s, Vector
from ..compilation.compiled import int64, kernel
from .surface import Surface

# Size of the traversal stack: more than a hierarchy has levels.
WAITING = 96

# Boxes are left this much later than computed: three roundings (Ize, Robust BVH ray traversal, 2013).
LATER = 1.0 + 8.0 * np.finfo(np.float64).eps

# Face, distance in lengths of the direction, weights of the corners 0 and 1, and whether its outside is seen.
Hit = tuple[int, float, float, float, bool]

# The axes across, up and along a ray; its steps across and up per step along; one over its last component.
Shear = tuple[int, int, int, float, float, float]


@kernel(inline="always")
def box_entry(
    nodes: Float32s,
    node: int,
    at: int,
    origin: Vector,
    over: Vector,
    begin: float,
    end: float,
) -> float:
    """Distance at which a ray enters a child's box, ∞ where it does not between ``begin`` and ``end``."""
    near, far = begin, end
    for axis in range(3):
        a = (nodes[node, at + axis] - origin[axis]) * over[axis]
        b = (nodes[node, at + 3 + axis] - origin[axis]) * over[axis]
        near = max(near, min(a, b))
        far = min(far, max(a, b) * LATER)
    return near if near <= far else np.inf


@kernel(inline="always")
def closest(
    surface: Surface,
    waiting: Int32s,
    root: int,
    origin: Vector,
    direction: Vector,
    begin: float,
    end: float,
    ignored: int,
) -> Hit:
    """The first face on a ray.

    Args:
        surface: ``surface_of``.
        waiting: (96,) traversal stack.
        root: node at which to begin: 0, but where several surfaces share their arrays.
        origin: edges of the cube.
        direction: any length.
        begin, end: range of distances, lengths of the direction.
        ignored: the face on which the ray starts, −1 for none.

    Returns:
        Face, −1 for none; distance; weights of its corners 0 and 1; whether the ray comes from outside.
    """
    over = (_over(direction[0]), _over(direction[1]), _over(direction[2]))
    nearest, first, second, outside = -1, 0.0, 0.0, False
    shear = _shear_of(direction)
    node, depth = root, 0
    while True:
        near = box_entry(surface.nodes, node, 0, origin, over, begin, end)
        far = box_entry(surface.nodes, node, 6, origin, over, begin, end)
        one, other = surface.children[node, 12], surface.children[node, 13]
        if far < near:
            near, far, one, other = far, near, other, one
        # The nearer child first; a farther inner node is pushed, a farther leaf is tested at once.
        node = -1
        for turn in range(2):
            at, child = (near, one) if turn == 0 else (far, other)
            if not at < np.inf or at > end:
                continue
            if child >= 0:
                if node < 0:
                    node = child
                else:
                    waiting[depth] = child
                    depth += 1
                continue
            start, count = ~child >> 3, ~child & 7
            for face in range(start, start + count):
                if face == ignored:
                    continue
                s, u, v, front = _meet(surface.triangles, face, origin, shear)
                if begin < s < end:
                    nearest, end, first, second, outside = face, s, u, v, front
        if node < 0:
            if depth == 0:
                return nearest, end, first, second, outside
            depth -= 1
            node = waiting[depth]


@kernel(inline="always")
def _over(a: float) -> float:
    return 1.0 / a if abs(a) > 1e-300 else 1e300


@kernel(inline="always")
def _shear_of(direction: Vector) -> Shear:
    x, y, z = abs(direction[0]), abs(direction[1]), abs(direction[2])
    along = 0 if x >= y and x >= z else (1 if y >= z else 2)
    across, up = (along + 1) % 3, (along + 2) % 3
    if direction[along] < 0.0:
        across, up = up, across
    over = 1.0 / direction[along]
    return across, up, along, direction[across] * over, direction[up] * over, over


@kernel(inline="always")
def _meet(triangles: Float32s, face: int, origin: Vector, shear: Shear) -> tuple[float, float, float, bool]:
    """Distance (∞ for none), weights of corners 0 and 1, and whether the outside is seen."""
    ax, ay, az = _sheared(triangles, face, 0, origin, shear)
    bx, by, bz = _sheared(triangles, face, 3, origin, shear)
    cx, cy, cz = _sheared(triangles, face, 6, origin, shear)
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    if (u < 0.0 or v < 0.0 or w < 0.0) and (u > 0.0 or v > 0.0 or w > 0.0):
        return np.inf, 0.0, 0.0, False
    total = u + v + w
    if total == 0.0:
        return np.inf, 0.0, 0.0, False
    return shear[5] * (u * az + v * bz + w * cz) / total, u / total, v / total, total > 0.0


@kernel(inline="always")
def _sheared(triangles: Float32s, face: int, at: int, origin: Vector, shear: Shear) -> Vector:
    across, up, along = shear[0], shear[1], shear[2]
    depth = triangles[face, at + along] - origin[along]
    return (
        triangles[face, at + across] - origin[across] - shear[3] * depth,
        triangles[face, at + up] - origin[up] - shear[4] * depth,
        depth,
    )


@kernel
def intersect(
    surface: Surface,
    origins: Floats,
    directions: Floats,
    ignored: Int32s,
    faces: Int32s,
    distances: Floats,
    weights: Floats,
    outside: NDArray[np.bool_],
) -> None:
    """The first face on each of many rays.

    Args:
        surface: ``surface_of``.
        origins, directions: (rays, 3), edges of the cube.
        ignored: (rays,) the face on which each starts, −1 for none.
        faces: (rays,), filled; −1 for none.
        distances: (rays,), filled: lengths of the direction, ∞ for none.
        weights: (rays, 2), filled: of corners 0 and 1.
        outside: (rays,), filled: whether the ray comes from outside.
    """
    waiting = np.empty(WAITING, dtype=np.int32)
    for k in range(len(origins)):
        origin = (origins[k, 0], origins[k, 1], origins[k, 2])
        direction = (directions[k, 0], directions[k, 1], directions[k, 2])
        face, s, u, v, front = closest(surface, waiting, 0, origin, direction, 0.0, np.inf, int64(ignored[k]))
        faces[k], distances[k], outside[k] = face, s, front
        weights[k, 0], weights[k, 1] = u, v

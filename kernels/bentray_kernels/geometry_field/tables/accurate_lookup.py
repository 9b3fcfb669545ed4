"""Accurate lookup in the outer field: a walk from the face of the nearest entry to the face that a ray hits.

The entry gives the face that a nearby ray hits or just misses. The ray is intersected with the plane of that
face and, if the point lies outside the face, with the planes of its neighbours: mostly the walk ends at the
face that the ray really hits, and the result is exact. A completed walk never reports a false hit.
"""

import numpy as np

from ...arrays import Float32s, Int32s
from ...compilation.compiled import kernel
from ...compilation.float32 import real
from ...meshes.face_plane import Meeting, beyond, meet_plane
from ...meshes.surface import Surface
from .cube import line_of, number_at
from .outer_field import OuterField, boundary_face

# Weights this far below 0 still lie in a face: float32 leaves gaps between faces otherwise.
SLACK = real(1e-5)

# The entry of a sample and itself, which no line through the cube has: it represents rays that miss.
NOTHING = 0

# Rays processed together, so that their memory loads overlap.
TOGETHER = 256

# Most steps to neighbours; more do not change any of 10,000 rays on a mesh of 75,000 faces.
STEPS = 32


@kernel(inline="always")
def settle(
    surface: Surface,
    face: int,
    side: float,
    steps: int,
    sx: float,
    sy: float,
    sz: float,
    dx: float,
    dy: float,
    dz: float,
) -> tuple[int, float, float, float]:
    """Walk from a face to the one that a ray hits.

    Args:
        surface: ``surface_of``.
        face: where to begin, a row of its triangles.
        side: 1 for rays that meet the outside of faces, −1 for their inside.
        steps: most neighbours to go to.
        sx, sy, sz: a point of the ray near the mesh, edges of the cube.
        dx, dy, dz: its direction.

    Returns:
        The face; distance from the point, in lengths of the direction; weights of corners 0 and 1. The face
        is −1 where the walk leaves the mesh, turns to its far side or does not end: the ray passes the mesh.
    """
    distance, first, second, third, determinant = meet_plane(surface.triangles, face, sx, sy, sz, dx, dy, dz)
    across = beyond(surface.links, face, first, second, third, SLACK)
    for _ in range(steps):
        if across == face or across < 0 or not side * determinant > 0.0:
            break
        face = across
        distance, first, second, third, determinant = meet_plane(
            surface.triangles, face, sx, sy, sz, dx, dy, dz
        )
        across = beyond(surface.links, face, first, second, third, SLACK)
    ends = across == face and side * determinant > 0.0
    return face if ends else -1, distance, first, second


@kernel
def find(
    surface: Surface,
    field: OuterField,
    origins: Float32s,
    directions: Float32s,
    steps: int,
    faces: Int32s,
    distances: Float32s,
    weights: Float32s,
) -> None:
    """The first face on each of many rays that begin outside the cube or on it.

    Args:
        surface: ``surface_of``.
        field: its outer field.
        origins, directions: (3, rays) float32, one row an axis; edges of the cube.
        steps: most neighbours to go to; a ray whose walk has not ended by then meets nothing.
        faces: (rays,), filled: rows of ``meshes.surface.triangles``, −1 for none.
        distances: (rays,), filled: lengths of the direction; ∞ for none.
        weights: (2, rays), filled: of corners 0 and 1.
    """
    tables = field.faces.ravel()
    place = np.empty(TOGETHER, dtype=np.int32)
    near, far = np.empty(TOGETHER, dtype=np.float32), np.empty(TOGETHER, dtype=np.float32)
    going, at = np.empty(TOGETHER, dtype=np.int32), np.empty(TOGETHER, dtype=np.int32)
    met, across = np.empty((3, TOGETHER), dtype=np.float32), np.empty(TOGETHER, dtype=np.int32)
    for start in range(0, len(faces), TOGETHER):
        rays = min(TOGETHER, len(faces) - start)
        enter(field.samples, origins, directions, start, place[:rays], near, far)
        still = 0
        for k in range(rays):
            r, face = start + k, boundary_face(tables[place[k]])
            faces[r], distances[r], weights[0, r], weights[1, r] = -1, np.inf, 0.0, 0.0
            going[still], at[still] = k, face
            still += face >= 0
        for _ in range(steps + 1):
            left, still = still, 0
            # A vectorised loop over all rays, then a loop that selects the rays that continue.
            for i in range(left):
                k = going[i]
                a, first, second, third, determinant = meet(
                    surface.triangles, at[i], origins, directions, near[k], start + k
                )
                to = beyond(surface.links, at[i], first, second, third, SLACK)
                across[i] = to if determinant > 0.0 else -1
                met[0, i], met[1, i], met[2, i] = a, first, second
            for i in range(left):
                k = going[i]
                r, face = start + k, at[i]
                faces[r] = face if across[i] == face else -1
                distances[r] = near[k] + min(max(met[0, i], real(0.0)), far[k] - near[k])
                weights[0, r], weights[1, r] = met[1, i], met[2, i]
                going[still], at[still] = k, across[i]
                still += across[i] >= 0 and across[i] != face
            if still == 0:
                break
        for r in range(start, start + rays):
            distances[r] = distances[r] if faces[r] >= 0 else np.inf


@kernel(inline="always")
def enter(
    n: int, origins: Float32s, directions: Float32s, start: int, place: Int32s, near: Float32s, far: Float32s
) -> None:
    """Entries, or ``NOTHING``, and distances at which the cube begins and ends, of rays from ``start`` on."""
    count = 6 * n * n
    for k in range(len(place)):
        r = start + k
        a, b, s, sx, sy, t, tx, ty = line_of(
            origins[0, r], origins[1, r], origins[2, r], directions[0, r], directions[1, r], directions[2, r]
        )
        entry, exit_ = number_at(s, sx, sy, n), number_at(t, tx, ty, n)
        place[k] = entry * count + exit_ if a < b else NOTHING
        near[k], far[k] = a, b


@kernel(inline="always")
def meet(
    triangles: Float32s, face: int, origins: Float32s, directions: Float32s, near: float, r: int
) -> Meeting:
    """``meet_plane`` for ray r, from where it enters the cube at the distance ``near``."""
    dx, dy, dz = directions[0, r], directions[1, r], directions[2, r]
    sx, sy, sz = origins[0, r] + near * dx, origins[1, r] + near * dy, origins[2, r] + near * dz
    return meet_plane(triangles, face, sx, sy, sz, dx, dy, dz)

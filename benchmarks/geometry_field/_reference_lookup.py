"""Reference lookups of the dissertation for many rays, (u, v), nearest or 4-D linear; and linear places.

For a linear place the 16 entries about a ray are averaged where they agree; (u, v) and the normal follow from
the face. Other rays are intersected with the plane of the face of their nearest entry.
"""

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.arrays import Float32s, Int32s, Ints
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.compilation.float32 import real
from bentray_kernels.geometry_field.tables.accurate_lookup import NOTHING, TOGETHER, meet
from bentray_kernels.geometry_field.tables.agreement import AGREE, NONE
from bentray_kernels.geometry_field.tables.cube import line_of, number_at
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.geometry_field.tables.quadrilinear import corner_of, lerp4, nearest_of
from bentray_kernels.geometry_field.tables.reference_field import linear_uv_at
from bentray_kernels.meshes.surface import Surface


@kernel(inline="always")
def corners(
    n: int,
    origins: Float32s,
    directions: Float32s,
    start: int,
    first: Int32s,
    ways: Float32s,
    near: Float32s,
    far: Float32s,
) -> None:
    """``corner_of`` the rays from ``start`` on, and their distances of entry and exit.

    Args:
        n: samples along an edge of the cube.
        origins, directions: (3, rays) float32.
        start: the first of the rays.
        first: (block,), filled; ``NOTHING`` for rays that miss the cube.
        ways: (4, at least block), filled.
        near, far: (at least block,), filled.
    """
    for k in range(len(first)):
        r = start + k
        a, b, s, sx, sy, t, tx, ty = line_of(
            origins[0, r], origins[1, r], origins[2, r], directions[0, r], directions[1, r], directions[2, r]
        )
        at, ways[0, k], ways[1, k], ways[2, k], ways[3, k] = corner_of(n, s, sx, sy, t, tx, ty)
        first[k] = at if a < b else NOTHING
        near[k], far[k] = a, b


@kernel
def find_linear(
    surface: Surface,
    field: OuterField,
    known: NDArray[np.uint8],
    origins: Float32s,
    directions: Float32s,
    faces: Int32s,
    distances: Float32s,
) -> None:
    """The first face on each of many rays that begin outside the cube or on it.

    Args:
        surface: ``surface_of``.
        field: its outer field.
        known: ``agreement`` of it.
        origins, directions: (3, rays) float32, one row an axis; edges of the cube.
        faces: (rays,), filled: of the nearest entry, a row of ``meshes.surface.triangles``; −1 for none.
        distances: (rays,), filled: lengths of the direction; ∞ for none.
    """
    n = field.samples
    entries, fractions, agreed = field.faces.ravel(), field.fractions.ravel(), known.ravel()
    first, ways = np.empty(TOGETHER, dtype=np.int32), np.empty((4, TOGETHER), dtype=np.float32)
    near, far = np.empty(TOGETHER, dtype=np.float32), np.empty(TOGETHER, dtype=np.float32)
    for start in range(0, len(faces), TOGETHER):
        rays = min(TOGETHER, len(faces) - start)
        corners(n, origins, directions, start, first[:rays], ways, near, far)
        for k in range(rays):
            r, state = start + k, agreed[first[k]]
            faces[r], distances[r] = -1, np.inf
            if state == NONE:
                continue
            corner = first[k], ways[0, k], ways[1, k], ways[2, k], ways[3, k]
            nearest, length = nearest_of(n, corner), far[k] - near[k]
            face = entries[nearest]
            if state == AGREE:
                distances[r] = near[k] + length * lerp4(fractions, n, corner, 1, 0)
            elif face >= 0:
                a, _, _, _, _ = meet(surface.triangles, face, origins, directions, near[k], r)
                if not 0.0 <= a <= length:
                    a = fractions[nearest] * length
                distances[r] = near[k] + a
            faces[r] = face


def nearest_uv(n: int, table: Float32s, origins: Float32s, directions: Float32s, uv: Float32s) -> None:
    """(u, v) of the entry nearest to each ray.

    Args:
        n: samples along an edge of the cube.
        table: ``uv_table``.
        origins, directions: (3, rays) float32, one row an axis; edges of the cube.
        uv: (rays, 2) float32, filled; NaN for rays that meet nothing.
    """
    # A pair of numbers is copied as one word.
    _copy_nearest(n, table.view(np.int64).ravel(), origins, directions, uv.view(np.int64)[:, 0])


@kernel
def _copy_nearest(n: int, table: Ints, origins: Float32s, directions: Float32s, found: Ints) -> None:
    place = np.empty(TOGETHER, dtype=np.int32)
    for start in range(0, len(found), TOGETHER):
        rays = min(TOGETHER, len(found) - start)
        for k in range(rays):
            r = start + k
            near, far, s, sx, sy, t, tx, ty = line_of(
                origins[0, r],
                origins[1, r],
                origins[2, r],
                directions[0, r],
                directions[1, r],
                directions[2, r],
            )
            entry = number_at(s, sx, sy, n) * (6 * n * n) + number_at(t, tx, ty, n)
            place[k] = entry if near < far else NOTHING
        for k in range(rays):
            found[start + k] = table[place[k]]


@kernel
def linear_uv(n: int, table: Float32s, origins: Float32s, directions: Float32s, uv: Float32s) -> None:
    """(u, v) averaged over the 16 entries about each ray, with the published weights.

    Entries that meet nothing are left out; where the nearest one meets nothing, so does the ray.

    Args:
        n, table, origins, directions, uv: as in ``nearest_uv``.
    """
    entries = table.ravel()
    first, ways = np.empty(TOGETHER, dtype=np.int32), np.empty((4, TOGETHER), dtype=np.float32)
    near, far = np.empty(TOGETHER, dtype=np.float32), np.empty(TOGETHER, dtype=np.float32)
    for start in range(0, len(uv), TOGETHER):
        rays = min(TOGETHER, len(uv) - start)
        corners(n, origins, directions, start, first[:rays], ways, near, far)
        for k in range(rays):
            corner = first[k], ways[0, k], ways[1, k], ways[2, k], ways[3, k]
            u, v = real(np.nan), real(np.nan)
            if first[k] != NOTHING:
                u, v = linear_uv_at(entries, n, corner, nearest_of(n, corner))
            uv[start + k, 0], uv[start + k, 1] = u, v

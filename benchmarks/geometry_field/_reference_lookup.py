"""Reference lookups of the dissertation: (u, v) of the nearest entry, or 4-D linear interpolation.

Section 5.3.4, for comparison: an average of (u, v) is meaningless where the entries lie on both sides of a
seam or silhouette.
"""

from __future__ import annotations

import numpy as np

from bentray_kernels.arrays import Float32s, Ints
from bentray_kernels.compiled import kernel
from bentray_kernels.float32 import higher, lower, real
from bentray_kernels.geometry_field.tables.accurate_lookup import NOTHING, TOGETHER
from bentray_kernels.geometry_field.tables.cube import line_of, number_at
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.geometry_field.tables.quadrilinear import Corner, lerp4
from bentray_kernels.meshes.face_plane import meet_plane
from bentray_kernels.meshes.surface import Surface

from ._linear_lookup import corners, nearest_of


def uv_table(surface: Surface, field: OuterField, samples: Float32s) -> Float32s:
    """The table as published: (6n², 6n², 2) float32 (u, v) by entry and exit, NaN for nothing.

    Args:
        surface: ``surface_of``.
        field: its outer field.
        samples: ``cube.samples(n)``, float32.
    """
    table = np.empty((*field.faces.shape, 2), dtype=np.float32)
    _fill_uv(surface, field, samples, table)
    return table


@kernel
def _fill_uv(surface: Surface, field: OuterField, samples: Float32s, table: Float32s) -> None:
    for i in range(len(samples)):
        for j in range(len(samples)):
            face = field.faces[i, j]
            if face < 0:
                table[i, j] = np.nan
                continue
            sx, sy, sz = samples[i, 0], samples[i, 1], samples[i, 2]
            dx, dy, dz = samples[j, 0] - sx, samples[j, 1] - sy, samples[j, 2] - sz
            _, first, second, third, _ = meet_plane(surface.triangles, face, sx, sy, sz, dx, dy, dz)
            for c in range(2):
                corners = surface.uv[face, 0, c], surface.uv[face, 1, c], surface.uv[face, 2, c]
                inside = first * corners[0] + second * corners[1] + third * corners[2]
                table[i, j, c] = lower(higher(inside, real(0.0)), real(1.0))


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
            nearest = 2 * nearest_of(n, corner)
            u, v = entries[nearest], entries[nearest + 1]
            # NaN is not equal to itself.
            if first[k] != NOTHING and u == u:
                u, v = lerp4(entries, n, corner, 2, 0), lerp4(entries, n, corner, 2, 1)
                if u != u:
                    u, v = _of_those_that_meet(entries, n, corner)
            else:
                u, v = real(np.nan), real(np.nan)
            uv[start + k, 0], uv[start + k, 1] = u, v


@kernel
def _of_those_that_meet(entries: Float32s, n: int, corner: Corner) -> tuple[float, float]:
    """Mean (u, v) of the entries that meet something, of which there is one."""
    at, a0, a1, a2, a3 = corner
    one, u, v, total = real(1.0), real(0.0), real(0.0), real(0.0)
    for k in range(16):
        i, j, m, p = k & 1, k >> 1 & 1, k >> 2 & 1, k >> 3
        weight = (a0 if i else one - a0) * (a1 if j else one - a1)
        weight *= (a2 if m else one - a2) * (a3 if p else one - a3)
        place = 2 * (at + (6 * n * j + i) * (6 * n * n) + 6 * n * p + m)
        if entries[place] == entries[place]:
            u, v = u + weight * entries[place], v + weight * entries[place + 1]
            total += weight
    return u / total, v / total

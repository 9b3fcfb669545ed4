"""Reference lookups of the dissertation for many rays: (u, v) of the nearest entry, or 4-D linear."""

import numpy as np

from bentray_kernels.arrays import Float32s, Ints
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.compilation.float32 import real
from bentray_kernels.geometry_field.tables.accurate_lookup import NOTHING, TOGETHER
from bentray_kernels.geometry_field.tables.cube import line_of, number_at
from bentray_kernels.geometry_field.tables.quadrilinear import nearest_of
from bentray_kernels.geometry_field.tables.reference_field import linear_uv_at

from ._linear_lookup import corners


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

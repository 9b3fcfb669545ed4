"""Plane lookup: intersection with the plane of the nearest entry, one memory access per ray for any mesh.

An entry holds the plane of the face that it meets: a normal in two numbers of 16 bits (Meyer et al., On
floating-point normal vectors, 2010, octahedral) and its distance from the cube's corner 0.
"""

from typing import NamedTuple

import numpy as np

from bentray_kernels.arrays import Float32s, Floats, Int32s
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.compilation.float32 import real, whole
from bentray_kernels.geometry_field.tables.accurate_lookup import TOGETHER, enter
from bentray_kernels.geometry_field.tables.cube import samples
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.meshes.surface import Surface

# Half the range of 16 bits: the sum of the components of a normal.
HALF = 32767


class PlaneTable(NamedTuple):
    """Planes n · p = w by entry and exit, and fractions for rays that miss their plane inside the cube.

    Attributes:
        samples: n along an edge of the cube.
        offsets: (2·36n⁴,) float32, every other one w, ∞ where the ray meets nothing.
        normals: the same memory as int32, the others the two components.
        fractions: of the outer field, (36n⁴,).
    """

    samples: int
    offsets: Float32s
    normals: Int32s
    fractions: Float32s


def plane_table(surface: Surface, field: OuterField) -> PlaneTable:
    """The planes of a field's faces.

    Args:
        surface: ``surface_of``.
        field: its outer field.
    """
    offsets = np.empty(2 * field.faces.size, dtype=np.float32)
    normals = offsets.view(np.int32)
    _fill(surface, field, samples(field.samples), offsets, normals)
    return PlaneTable(field.samples, offsets, normals, field.fractions.ravel())


@kernel
def _fill(surface: Surface, field: OuterField, places: Floats, offsets: Float32s, normals: Int32s) -> None:
    count = len(places)
    for i in range(count):
        for j in range(count):
            at, face = 2 * (i * count + j), field.faces[i, j]
            offsets[at], normals[at + 1] = np.inf, 0
            if face < 0:
                continue
            t = surface.triangles[face]
            px, py, pz = t[3] - t[0], t[4] - t[1], t[5] - t[2]
            qx, qy, qz = t[6] - t[0], t[7] - t[1], t[8] - t[2]
            normals[at + 1] = _packed(py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx)
            # With the rounded normal, through the exact intersection of the entry's ray.
            x, y, z = _unpacked(normals[at + 1])
            way = field.fractions[i, j]
            offsets[at] = (
                x * (places[i, 0] + way * (places[j, 0] - places[i, 0]))
                + y * (places[i, 1] + way * (places[j, 1] - places[i, 1]))
                + z * (places[i, 2] + way * (places[j, 2] - places[i, 2]))
            )


@kernel
def find_by_plane(table: PlaneTable, origins: Float32s, directions: Float32s, distances: Float32s) -> None:
    """Distances of the first hits of many rays that begin outside the cube or on it.

    Args:
        table: ``plane_table``.
        origins, directions: (3, rays) float32, one row an axis; edges of the cube.
        distances: (rays,), filled: lengths of the direction; ∞ for none.
    """
    place = np.empty(TOGETHER, dtype=np.int32)
    near, far = np.empty(TOGETHER, dtype=np.float32), np.empty(TOGETHER, dtype=np.float32)
    for start in range(0, len(distances), TOGETHER):
        rays = min(TOGETHER, len(distances) - start)
        enter(table.samples, origins, directions, start, place[:rays], near, far)
        for k in range(rays):
            r, at = start + k, place[k]
            offset = table.offsets[2 * at]
            x, y, z = _unpacked(table.normals[2 * at + 1])
            along = x * directions[0, r] + y * directions[1, r] + z * directions[2, r]
            distance = (offset - (x * origins[0, r] + y * origins[1, r] + z * origins[2, r])) / along
            # No branch for rays that miss; one for the few whose plane intersection is invalid.
            meets = offset < np.inf
            if meets and not near[k] <= distance <= far[k]:
                distance = near[k] + table.fractions[at] * (far[k] - near[k])
            distances[r] = distance if meets else np.inf


@kernel(inline="always")
def _packed(x: float, y: float, z: float) -> int:
    """A direction projected on the octahedron |x| + |y| + |z| = 1, its lower half folded outwards."""
    total = abs(x) + abs(y) + abs(z)
    if total == 0.0:
        return 0
    x, y = x / total, y / total
    if z < 0.0:
        x, y = (1.0 - abs(y)) * np.copysign(1.0, x), (1.0 - abs(x)) * np.copysign(1.0, y)
    return (round(HALF * x) + HALF) << 16 | (round(HALF * y) + HALF)


@kernel(inline="always")
def _unpacked(packed: int) -> tuple[float, float, float]:
    """That direction, of any length."""
    half = real(HALF)
    x, y = real(whole(packed >> 16 & 65535)) - half, real(whole(packed & 65535)) - half
    z = half - abs(x) - abs(y)
    # Folded back: what is beyond the edge of the upper half.
    below = -z if z < real(0.0) else real(0.0)
    return x + (below if x < real(0.0) else -below), y + (below if y < real(0.0) else -below), z

"""Linear interpolation where it means something: of the place on the ray, in cells whose entries agree.

The sixteen entries about a ray are averaged when all of them meet the mesh, and about as far along; (u, v)
and the normal follow from the face in the end. Other rays are cut with the plane of their nearest entry's
face.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...compiled import kernel
from ...float32 import real
from ...meshes.surface import Reals, Surface, Words
from .accurate_lookup import TOGETHER, meet
from .outer_field import OuterField
from .quadrilinear import corners, lerp4, nearest_of

# Entries agree when their places differ by at most so many distances of samples.
APART = 3.0

# What is known of the sixteen entries: none meets the mesh; all do, and agree; anything else.
NONE, AGREE, MIXED = 0, 1, 2


def agreement(field: OuterField) -> NDArray[np.uint8]:
    """``NONE``, ``AGREE`` or ``MIXED`` for the sixteen entries from each one on, (6n², 6n²) uint8.

    The last samples of each face of the cube begin no sixteen; no lookup asks for theirs.
    """
    known = np.full(field.faces.shape, MIXED, dtype=np.uint8)
    _compare(field, real(APART / field.samples), known)
    return known


@kernel
def _compare(field: OuterField, apart: float, known: NDArray[np.uint8]) -> None:
    n = field.samples
    row = 6 * n
    for entry in range(len(known) - row):
        if entry % n == n - 1:
            continue
        for exit_ in range(len(known) - row):
            if exit_ % n == n - 1:
                continue
            count, low, high = 0, real(2.0), real(-1.0)
            for i in (entry, entry + 1, entry + row, entry + row + 1):
                for j in (exit_, exit_ + 1, exit_ + row, exit_ + row + 1):
                    count += field.faces[i, j] >= 0
                    low, high = min(low, field.fractions[i, j]), max(high, field.fractions[i, j])
            if count == 0:
                known[entry, exit_] = NONE
            elif count == 16 and high - low <= apart:
                known[entry, exit_] = AGREE


@kernel
def find_linear(
    surface: Surface,
    field: OuterField,
    known: NDArray[np.uint8],
    origins: Reals,
    directions: Reals,
    faces: Words,
    distances: Reals,
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

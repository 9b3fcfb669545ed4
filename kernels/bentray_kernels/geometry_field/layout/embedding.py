"""Tutte embedding: fold-free flat layouts for meshes whose conformal layout folds."""

import numpy as np
from scipy.sparse import csc_array

from ...arrays import Floats, Ints
from .conformal import Disk, factor
from .distortion import signed_areas

# Rings of faces about a fold that are laid out anew, at most.
RINGS = 8

# Part of the faces that may be flipped; where it is more, there is no small fold.
MAX_FLIPPED = 0.01


def round_embedding(disk: Disk) -> Floats:
    """Each inner vertex in the middle of its neighbours, the boundary on a circle.

    Tutte, "How to draw a graph" (1963): no triangle flips, however bad its shape; angles are not kept.

    Returns:
        (vertices, 2).
    """
    plane = np.zeros((len(disk.vertices), 2))
    lengths = disk.side_lengths
    angle = 2.0 * np.pi * np.cumsum(lengths) / lengths.sum()
    plane[disk.boundary] = np.column_stack((np.cos(angle), np.sin(angle)))
    return relaxed(plane, disk.faces, np.flatnonzero(disk.inside))


def unfolded(plane: Floats, disk: Disk) -> Floats:
    """The layout with small folds smoothed out: rings about flipped faces are laid out anew.

    Args:
        plane: (vertices, 2).
        disk: what it is a layout of.

    Returns:
        (vertices, 2); the boundary stays, and so may folds that reach it.
    """
    for rings in range(1, RINGS + 1):
        flipped = signed_areas(plane[disk.faces]) <= 0.0
        if not 0.0 < flipped.mean() < MAX_FLIPPED:
            break
        near = np.zeros(len(plane), bool)
        near[disk.faces[flipped]] = True
        for _ in range(rings - 1):
            near[disk.faces[near[disk.faces].any(axis=1)]] = True
        plane = relaxed(plane, disk.faces, np.flatnonzero(near & disk.inside))
    return plane


def relaxed(plane: Floats, faces: Ints, moving: Ints) -> Floats:
    """The layout with some vertices in the middle of their neighbours, and the others where they are.

    Args:
        plane: (vertices, 2).
        faces: (faces, 3).
        moving: the vertices that move, none of them on the boundary.
    """
    plane = plane.copy()
    if len(moving) == 0:
        return plane
    first, other = np.roll(faces, -1, axis=1).ravel(), faces.ravel()
    # Each inner edge comes once in either direction.
    links = csc_array((np.ones(len(first)), (first, other)), shape=(len(plane), len(plane)))
    degree = np.asarray(links.sum(axis=1)).ravel()
    rows = links[moving]
    staying = np.ones(len(plane), bool)
    staying[moving] = False
    matrix = (
        csc_array((degree[moving], (np.arange(len(moving)),) * 2), shape=(len(moving),) * 2) - rows[:, moving]
    )
    plane[moving] = factor(matrix).solve(rows[:, staying] @ plane[staying])
    return plane

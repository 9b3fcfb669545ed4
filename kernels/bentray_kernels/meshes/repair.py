"""Repairs of triangles: corners that nearly agree, faces without area, faces listed twice."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Flags, Floats, Ints
from .mesh import TriangleMesh
from .topology import components, edges_of

# Lowest ratio of a triangle's height to its longest side: angles of thinner ones are dominated by rounding.
THINNEST = 1e-9
# Rounding of files, relative to the largest coordinate: six digits, or less.
ROUNDED = 1e-5
# Shortest side of a face over the distance of corners that are merged: no face falls together.
CLEAR = 10.0
# A face without area may be the neighbour of another one: repairs follow each other.
PASSES = 64


class Repaired(NamedTuple):
    """Faces, (faces, 3) rows of the vertices, and the number of repairs."""

    faces: Ints
    repairs: int


def thinness(vertices: Floats, faces: Ints) -> Floats:
    """(faces,) height over the longest side; 0 if it is below the rounding of the coordinates."""
    mesh = TriangleMesh(vertices, faces.astype(np.int32))
    longest = _sides(vertices, faces).max(axis=1)
    rounding = np.finfo(np.float64).eps * np.abs(vertices).max()
    longest = np.where(longest > 0.0, longest, 1.0)
    height = 2.0 * np.linalg.norm(mesh.face_normals, axis=1) / longest
    return np.asarray(np.where(height <= 4.0 * rounding, 0.0, height / longest))


def without_repetition(faces: Ints) -> Repaired:
    """Leave out faces of the same three vertices as an earlier one, in any orientation."""
    low, middle, high = np.sort(faces, axis=1).T
    # Stable: of the same faces the first comes first. Faster than unique rows.
    order = np.lexsort((high, low * (int(high.max()) + 1) + middle))
    ascending = np.stack((low, middle, high), axis=1)[order]
    again = np.zeros(len(faces), bool)
    again[order[1:]] = (ascending[1:] == ascending[:-1]).all(axis=1)
    return Repaired(faces[~again], int(again.sum()))


def merged_nearly(vertices: Floats, faces: Ints) -> Repaired:
    """Merge vertices of open edges that differ by the rounding of a file only.

    They are merged where that closes edges and makes none of three faces; faces keep their sides, which are
    longer than ``CLEAR`` times the distance of merged vertices.

    Returns:
        The faces with the first vertex of each place, and the number of merged vertices.
    """
    edges, _, count = edges_of(faces)
    ends = np.unique(edges[count == 1])
    if not ends.size:
        return Repaired(faces, 0)
    reach = min(ROUNDED * float(np.abs(vertices).max()), float(_sides(vertices, faces).min()) / CLEAR)
    pairs = cKDTree(vertices[ends]).query_pairs(reach, output_type="ndarray")
    number = _merged(len(vertices), ends[pairs])
    joined = number[faces]
    after = edges_of(joined)[2]
    closes = (after == 1).sum() < (count == 1).sum() and (after > 2).sum() <= (count > 2).sum()
    if not closes or _repeats_a_vertex(joined).any():
        return Repaired(faces, 0)
    return Repaired(joined, int((number != np.arange(len(number))).sum()))


def without_flat_faces(vertices: Floats, faces: Ints) -> Repaired:
    """Leave out faces without area, so that the surface stays the same and stays closed.

    A face whose corners are at one place or two disappears, and so does one on a line that closes nothing.
    Other faces on a line are given to the neighbour across the longest side, which the middle corner divides.

    Returns:
        The faces, of which some may still be thinner than ``THINNEST``, and the number of those left out.
    """
    number = len(faces)
    sides = _sides(vertices, faces)
    short = sides <= THINNEST * sides.max(axis=1, keepdims=True)
    ends = np.stack((faces, np.roll(faces, -1, axis=1)), axis=-1)[short]
    faces = _merged(len(vertices), ends)[faces]
    faces = faces[~_repeats_a_vertex(faces)]
    left_out = number - len(faces)
    for _ in range(PASSES):
        flat = thinness(vertices, faces) < THINNEST
        mended = _divided(vertices, faces, flat) if flat.any() and not flat.all() else None
        if mended is None:
            break
        left_out += mended.repairs
        faces = mended.faces
    return Repaired(faces, left_out)


def _divided(vertices: Floats, faces: Ints, flat: Flags) -> Repaired | None:
    """One pass of ``without_flat_faces`` over faces on a line; None where nothing can be repaired."""
    edges, side_edge, count = edges_of(faces)
    span = int(faces.max()) + 1
    existing = edges[:, 0] * span + edges[:, 1]
    thin = np.flatnonzero(flat)
    longest = np.argmax(_sides(vertices, faces[thin]), axis=1)
    edge = side_edge[3 * thin + longest]
    # The sum of the two faces along an edge, less one, is the other.
    both = np.bincount(side_edge, np.arange(len(side_edge)) // 3, len(edges)).astype(np.int64)
    across = np.where(count[edge] == 2, both[edge] - thin, -1)
    start, end, middle = (faces[thin, (longest + step) % 3] for step in range(3))
    corner = faces[across].sum(axis=1) - start - end
    new = np.minimum(middle, corner) * span + np.maximum(middle, corner)
    gives = (across >= 0) & ~flat[across] & (corner != middle) & ~np.isin(new, existing)
    # Each neighbour and each new edge once in a pass.
    for edge_of in (across, new):
        first = np.zeros(len(thin), bool)
        first[np.flatnonzero(gives)[np.unique(edge_of[gives], return_index=True)[1]]] = True
        gives &= first
    # No edge opens without a face none of whose sides has two faces.
    loose = (count[side_edge.reshape(-1, 3)[thin]] != 2).all(axis=1)
    gives &= ~loose
    gone = gives | loose | (count[edge] == 1)
    if not gone.any():
        return None
    neighbour = faces[across[gives]]
    halves = [
        np.where(neighbour == ends[gives, np.newaxis], middle[gives, np.newaxis], neighbour)
        for ends in (start, end)
    ]
    kept = faces.copy()
    kept[across[gives]] = halves[0]
    # A second half takes the row of the face that is left out.
    kept[thin[gives]] = halves[1]
    return Repaired(np.delete(kept, thin[gone & ~gives], axis=0), int(gone.sum()))


def _sides(vertices: Floats, faces: Ints) -> Floats:
    """(faces, 3) lengths; side k goes from corner k to the next one."""
    corners = vertices[faces]
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=-1))


def _merged(number: int, pairs: Ints) -> Ints:
    """(number,) the first of the vertices that pairs connect to each one."""
    labels = components(number, pairs[:, 0], pairs[:, 1])
    _, first = np.unique(labels, return_index=True)
    return np.asarray(first[labels], np.int64)


def _repeats_a_vertex(faces: Ints) -> Flags:
    return np.asarray((faces == np.roll(faces, 1, axis=1)).any(axis=1))

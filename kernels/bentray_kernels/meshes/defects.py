"""Mesh repair: defects are corrected where that is unambiguous, else the mesh is rejected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import InvalidInput
from .mesh import TriangleMesh
from .opening import cut_open
from .topology import components, edges_of, side_ends, topology_of

# Lowest ratio of a triangle's height to its longest side: angles of thinner ones are dominated by rounding.
THINNEST = 1e-9


@dataclass(frozen=True)
class SoundMesh:
    """One connected, oriented surface, and the repairs made.

    Attributes:
        mesh: every vertex is used by one fan of faces; closed surfaces have their normals outward.
        origin: (vertices,) original vertex of each.
        merged: number of vertices at the position of another one.
        unused: number of vertices without a face.
        turned: number of faces with reversed orientation.
        parted: number of vertices added where fans of faces touched in one.
        holes: boundaries; 0 for a closed surface.
        genus: handles.
    """

    mesh: TriangleMesh
    origin: Ints
    merged: int
    unused: int
    turned: int
    parted: int
    holes: int
    genus: int


def sound(vertices: Floats, faces: NDArray[np.integer]) -> SoundMesh:
    """Merge coincident vertices, orient faces consistently, split touching fans, and reject other defects.

    Args:
        vertices: (vertices, 3), any unit.
        faces: (faces, 3) rows of ``vertices``.

    Raises:
        InvalidInput: for other shapes, no faces, rows out of range, vertices that are not finite, faces of no
            area, edges of three faces or more, a surface that cannot be oriented, or several pieces.
    """
    rows: Ints = np.asarray(faces, np.int64)
    vertices = np.asarray(vertices, np.float64)
    _plain(vertices, rows)
    # Adding 0 makes −0 the same as 0.
    _, first, place = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    used, inverse = np.unique(place.ravel()[rows], return_inverse=True)
    joined = inverse.reshape(-1, 3)
    origin = first[used]
    mesh = TriangleMesh(vertices[origin], joined.astype(np.int32))
    thin = _thinness(mesh)
    flat, needles = int((thin == 0.0).sum()), int((thin < THINNEST).sum())
    if flat:
        raise InvalidInput("faces", f"{flat} without area", "triangles whose corners are not on one line")
    if needles:
        accepted = f"triangles as high as {THINNEST:g} of their longest side or higher"
        raise InvalidInput("faces", f"{needles} needles without height", accepted)
    oriented, turned = _turned_alike(joined)
    topology = topology_of(oriented)
    pieces = int(topology.pieces.max()) + 1
    if pieces > 1:
        raise InvalidInput("faces", f"{pieces} pieces", "one connected surface")
    whole = cut_open(topology, np.zeros(len(topology.edges), bool))
    holes = len(topology.boundary_loops)
    result = TriangleMesh(mesh.vertices[whole.origin], whole.faces.astype(np.int32))
    if holes == 0 and _volume(result) < 0.0:
        result = TriangleMesh(result.vertices, np.ascontiguousarray(result.faces[:, ::-1]))
        turned = len(faces) - turned
    in_a_face = np.zeros(len(vertices), bool)
    in_a_face[rows] = True
    return SoundMesh(
        result,
        origin[whole.origin],
        merged=int(in_a_face.sum()) - len(used),
        unused=int((~in_a_face).sum()),
        turned=turned,
        parted=len(whole.origin) - len(used),
        holes=holes,
        genus=topology_of(result.faces).genus,
    )


def _plain(vertices: Floats, faces: Ints) -> None:
    if len(faces) == 0:
        raise InvalidInput("faces", "none", "one triangle or more")
    for field, rows in (("vertices", vertices), ("faces", faces)):
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise InvalidInput(field, f"shape {rows.shape}", "three numbers in each")
    if faces.min() < 0 or faces.max() >= len(vertices):
        wrong = int(((faces < 0) | (faces >= len(vertices))).sum())
        accepted = f"rows 0 to {len(vertices) - 1} of the vertices"
        raise InvalidInput("faces", f"{wrong} corners out of range", accepted)
    infinite = int((~np.isfinite(vertices)).any(axis=1).sum())
    if infinite:
        raise InvalidInput("vertices", f"{infinite} that are not finite", "finite numbers")
    # The square of an area must neither overflow nor vanish.
    span = float(np.ptp(vertices[faces.ravel()], axis=0).max())
    if not 1e-60 < span < 1e60:
        raise InvalidInput("vertices", f"a box of {span:g}", "a longest side between 1e-60 and 1e60")


def _thinness(mesh: TriangleMesh) -> Floats:
    """(faces,) height over the longest side; 0 if it is below the rounding of the coordinates."""
    corners = mesh.corners
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=-1).max(axis=1)
    rounding = np.finfo(np.float64).eps * np.abs(mesh.vertices).max()
    longest = np.where(longest > 0.0, longest, 1.0)
    height = 2.0 * np.linalg.norm(mesh.face_normals, axis=1) / longest
    return np.asarray(np.where(height <= 4.0 * rounding, 0.0, height / longest))


def _turned_alike(faces: Ints) -> tuple[Ints, int]:
    """Orient the faces consistently, with the fewest changes in each piece; returns the number changed."""
    _, side_edge, count = edges_of(faces)
    if (count > 2).any():
        raise InvalidInput(
            "faces", f"{(count > 2).sum()} edges of three faces or more", "two at most along an edge"
        )
    order = np.argsort(side_edge, kind="stable")
    second = np.cumsum(count)[count == 2] - 1
    one, other = order[second - 1], order[second]
    start, _ = side_ends(faces)
    # Each face occurs in both orientations; compatible ones along an edge are linked.
    number, alike = len(faces), (start[one] == start[other]).astype(np.int64)
    f, g = one // 3, other // 3
    labels = components(
        2 * number,
        np.concatenate((f, f + number)),
        np.concatenate((g + number * alike, g + number * (1 - alike))),
    )
    if (labels[:number] == labels[number:]).any():
        raise InvalidInput("faces", "a surface that cannot be oriented", "one with two sides")
    # Of the two labels of a piece, the one with more faces as they are stays.
    count = np.bincount(labels[:number], minlength=int(labels.max()) + 1)
    turned = count[labels[:number]] < count[labels[number:]]
    # Of two as large, the one that holds the piece's first face as it is: the lower label.
    turned |= (count[labels[:number]] == count[labels[number:]]) & (labels[:number] > labels[number:])
    return np.where(turned[:, np.newaxis], faces[:, ::-1], faces), int(turned.sum())


def _volume(mesh: TriangleMesh) -> float:
    """Enclosed by a closed surface; negative where its normals point inward."""
    middle = mesh.vertices.mean(axis=0)
    first, second, third = np.moveaxis(mesh.corners - middle, 1, 0)
    return float((first * np.cross(second, third)).sum() / 6.0)

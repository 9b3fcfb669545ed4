"""Mesh repair: defects are corrected where that is unambiguous, else the mesh is rejected."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..arrays import Floats, Ints
from ..errors import InvalidInput
from .mesh import TriangleMesh
from .opening import cut_open
from .repair import THINNEST, merged_nearly, thinness, without_flat_faces, without_repetition
from .topology import Topology, components, edges_of, side_ends, topology_of


@dataclass(frozen=True)
class SoundMesh:
    """One connected, oriented surface, and the repairs made.

    Attributes:
        mesh: every vertex is used by one fan of faces; closed surfaces have their normals outward.
        origin: (vertices,) original vertex of each.
        merged: number of vertices at the position of another one, or as near to it as a file rounds.
        unused: number of vertices without a face.
        flat: number of faces without area that were left out; a neighbour was divided where that was needed.
        repeated: number of faces of the same vertices as another one that were left out.
        turned: number of faces with reversed orientation.
        parted: number of vertices added where fans of faces touched in one.
        holes: boundaries; 0 for a closed surface.
        genus: handles.
    """

    mesh: TriangleMesh
    origin: Ints
    merged: int
    unused: int
    flat: int
    repeated: int
    turned: int
    parted: int
    holes: int
    genus: int


def sound(vertices: Floats, faces: NDArray[np.integer]) -> SoundMesh:
    """Repair what has one repair, orient faces consistently, split touching fans, and reject other defects.

    Args:
        vertices: (vertices, 3), any unit.
        faces: (faces, 3) rows of ``vertices``.

    Raises:
        InvalidInput: for other shapes, no faces, rows out of range, vertices of faces that are not finite,
            faces without area that cannot be left out, edges of three faces or more, a surface that cannot be
            oriented, or several pieces.
    """
    rows: Ints = np.asarray(faces, np.int64)
    vertices = np.asarray(vertices, np.float64)
    _plain(vertices, rows)
    in_a_face = np.unique(rows)
    # Adding 0 makes −0 the same as 0.
    _, first, number = np.unique(vertices[in_a_face] + 0.0, axis=0, return_index=True, return_inverse=True)
    origin = in_a_face[first]
    joined: Ints = number.ravel()[np.searchsorted(in_a_face, rows)]
    points = vertices[origin]
    joined, repeated = without_repetition(joined)
    joined, flat = without_flat_faces(points, joined)
    _check_area(points, origin, joined, flat)
    joined, near = merged_nearly(points, joined)
    joined, repeated_near = without_repetition(joined) if near else (joined, 0)
    oriented, turned = _turned_alike(joined, origin, vertices)
    topology = topology_of(oriented)
    _check_one_piece(points, topology)
    whole = cut_open(topology, np.zeros(len(topology.edges), bool))
    holes = len(topology.boundary_loops)
    result = TriangleMesh(points[whole.origin], whole.faces.astype(np.int32))
    if holes == 0 and _volume(result) < 0.0:
        result = TriangleMesh(result.vertices, np.ascontiguousarray(result.faces[:, ::-1]))
        turned = len(oriented) - turned
    return SoundMesh(
        result,
        origin[whole.origin],
        merged=len(in_a_face) - len(origin) + near,
        unused=len(vertices) - len(in_a_face),
        flat=flat,
        repeated=repeated + repeated_near,
        turned=turned,
        parted=len(whole.origin) - len(np.unique(oriented)),
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
    infinite = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    infinite = infinite[np.isin(infinite, faces)]
    if infinite.size:
        given = f"{infinite.size} that are not finite, the first number {infinite[0]} (from 0)"
        raise InvalidInput("vertices", given, "finite numbers, or no face with them")
    # The square of an area must neither overflow nor vanish.
    span = float(np.ptp(vertices[faces.ravel()], axis=0).max())
    if not 1e-60 < span < 1e60:
        raise InvalidInput("vertices", f"a box of {span:g}", "a longest side between 1e-60 and 1e60")


def _check_area(points: Floats, origin: Ints, faces: Ints, left_out: int) -> None:
    """Reject faces without area that are left; ``left_out`` others are gone."""
    if not len(faces):
        raise InvalidInput("faces", f"{left_out} without area and no other", "triangles with an area")
    thin = thinness(points, faces)
    number = int((thin < THINNEST).sum())
    if number:
        corners = ", ".join(map(str, origin[faces[np.argmin(thin)]]))
        given = f"{number} without area, the first between the vertices {corners}"
        raise InvalidInput(
            "faces", given, f"triangles as high as {THINNEST:g} of their longest side or higher"
        )


def _check_one_piece(points: Floats, topology: Topology) -> None:
    """Reject several pieces, with the distance of their vertices: what belongs together may lie apart."""
    pieces = int(topology.pieces.max()) + 1
    if pieces == 1:
        return
    largest = topology.pieces == np.bincount(topology.pieces).argmax()
    own, others = (np.unique(topology.faces[piece]) for piece in (largest, ~largest))
    apart = float(cKDTree(points[own]).query(points[others])[0].min())
    given = f"{pieces} pieces that share no edges, their nearest corners {apart:g} apart"
    raise InvalidInput("faces", given, "one connected surface: merge its corners, or keep the largest piece")


def _turned_alike(faces: Ints, origin: Ints, vertices: Floats) -> tuple[Ints, int]:
    """Orient the faces consistently, with the fewest changes in each piece; returns the number changed.

    Args:
        faces: (faces, 3) rows of ``origin``.
        origin: original vertices, rows of ``vertices``, for errors.
        vertices: (vertices, 3).
    """
    edges, side_edge, count = edges_of(faces)
    if (count > 2).any():
        start, end = origin[edges[np.argmax(count > 2)]]
        where = ", ".join(f"{value:g}" for value in vertices[start])
        first = f"the first from vertex {start} ({where}) to {end}"
        given = f"{(count > 2).sum()} edges of three faces or more, {first}"
        raise InvalidInput("faces", given, "two at most along an edge")
    order = np.argsort(side_edge, kind="stable")
    second = np.cumsum(count)[count == 2] - 1
    earlier, other = order[second - 1], order[second]
    start, _ = side_ends(faces)
    # Each face occurs in both orientations; compatible ones along an edge are linked.
    number, alike = len(faces), (start[earlier] == start[other]).astype(np.int64)
    f, g = earlier // 3, other // 3
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

"""A mesh for ray intersection: triangles in the order of a bounding volume hierarchy, with neighbours."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Float32s, Int32s, Ints
from ..errors import InvalidInput
from .hierarchy import build_hierarchy
from .mesh import Chart
from .topology import edges_of

# 4-byte words of a triangle and of a node: a line of the cache each.
WORDS = 16


class Surface(NamedTuple):
    """A mesh in the unit cube, with spatially sorted faces.

    Attributes:
        triangles: (faces, 16) float32: three corners of x, y, z; then words of ``links``.
        links: the same memory as int32: words 9, 10, 11 are the faces across the edges 01, 12, 20, −1 for
            none, all in this order of faces.
        nodes: (nodes, 16) float32: lower and upper corner of the first child's box, of the second's.
        children: the same memory as int32: words 12 and 13 are the children: a node, or the complement of
            8·first face + number of faces.
        normals: (faces, 3 corners, 3) float32 unit vectors outward, smooth over the mesh.
        uv: (faces, 3 corners, 2) float32, as ``Chart.uv``.
        order: (faces,) rows of the chart's mesh.
    """

    triangles: Float32s
    links: Int32s
    nodes: Float32s
    children: Int32s
    normals: Float32s
    uv: Float32s
    order: Int32s


def surface_of(chart: Chart) -> Surface:
    """Sort a mesh's faces into boxes and link each with its neighbours.

    Args:
        chart: its mesh in the unit cube, closed or open.

    Raises:
        InvalidInput: for a mesh without faces, with too many, or outside the unit cube.
    """
    mesh = chart.mesh
    if not 1 <= len(mesh.faces) < 1 << 27:
        raise InvalidInput("faces", len(mesh.faces), f"1 to {(1 << 27) - 1} faces")
    corners = mesh.corners.astype(np.float32)
    if not (corners.min() >= -1e-6 and corners.max() <= 1.0 + 1e-6):
        value = f"{corners.min():.6g} to {corners.max():.6g}"
        raise InvalidInput("vertices", value, "a mesh in the unit cube (TriangleMesh.in_unit_cube)")
    order = np.arange(len(corners), dtype=np.int32)
    nodes = np.zeros((max(2 * len(corners), 2), WORDS), dtype=np.float32)
    lows, highs = corners.min(axis=1), corners.max(axis=1)
    used = build_hierarchy(lows, highs, order, nodes, nodes.view(np.int32))
    nodes, loose = _lines(used), nodes
    nodes[:] = loose[:used]
    triangles = _lines(len(corners))
    triangles[:, :9] = corners[order].reshape(-1, 9)
    links = triangles.view(np.int32)
    links[:, 9:12] = _neighbours(mesh.faces[order])
    normals = mesh.vertex_normals[mesh.faces[order]].astype(np.float32)
    uv = np.ascontiguousarray(chart.uv[order], dtype=np.float32)
    return Surface(triangles, links, nodes, nodes.view(np.int32), normals, uv, order)


def _lines(count: int) -> Float32s:
    """(count, 16) zeros, each row one cache line: cache misses dominate the time of lookups."""
    room = np.zeros(count * WORDS + WORDS, dtype=np.float32)
    start = -room.ctypes.data % (4 * WORDS) // 4
    return room[start : start + count * WORDS].reshape(count, WORDS)


def _neighbours(faces: NDArray[np.int32]) -> Ints:
    """(faces, 3) the face across each edge, −1 where there is none or more than one."""
    _, edge, count = edges_of(faces)
    sides = np.argsort(edge, kind="stable")
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    pair = count == 2
    a, b = sides[first[pair]], sides[first[pair] + 1]
    across = np.full(len(edge), -1, dtype=np.int64)
    across[a], across[b] = b // 3, a // 3
    return across.reshape(-1, 3)

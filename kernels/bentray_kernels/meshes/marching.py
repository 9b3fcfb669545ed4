"""Iso-surfaces as triangle meshes, by marching tetrahedra."""

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Flags, Floats, Ints
from ..errors import InvalidInput
from .mesh import TriangleMesh

# Least part of an edge on either side of the surface: triangles at a node on the surface keep an area.
MIN_FRACTION = 0.01

# The six tetrahedra of a cell, each from corner (0, 0, 0) along the axes in one order to (1, 1, 1). Two cells
# cut their common face along the same diagonal, so that the surface has no cracks.
TETRAHEDRA = np.array(
    [
        np.cumsum([(0, 0, 0), *(tuple(int(axis == step) for axis in range(3)) for step in order)], axis=0)
        for order in permutations(range(3))
    ]
)


def isosurface_mesh(values: NDArray[np.floating | np.integer], spacing: Floats, iso: float) -> TriangleMesh:
    """The closed surface about all that is above an iso-value, its normals towards lower values.

    Payne and Toga, "Surface mapping brain function on 3D models" (1990): within a tetrahedron the values are
    linear. What reaches the faces of the volume is closed there.

    Args:
        values: (nx, ny, nz), finite.
        spacing: (3,) m.
        iso: in the unit of the values.

    Returns:
        Vertices in m from node (0, 0, 0); maybe of several pieces.

    Raises:
        InvalidInput: where no value, or every value, is above the iso-value.
    """
    inside = np.pad(values > iso, 1)
    if not inside.any() or inside[1:-1, 1:-1, 1:-1].all():
        low, high = float(values.min()), float(values.max())
        raise InvalidInput("iso", iso, f"a value in [{low:g}, {high:g}), the range of the volume")
    field = np.pad(np.asarray(values, np.float64), 1, mode="edge")
    nodes = _tetrahedra(inside)
    ends = _triangles(nodes, inside.ravel()[nodes])
    span = field.size
    keys, inverse = np.unique(ends[..., 0] * span + ends[..., 1], return_inverse=True)
    start, end = keys // span, keys % span
    shape = np.array(field.shape)
    a, b = field.ravel()[start], field.ravel()[end]
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = (iso - a) / (b - a)
    end_nodes = [np.column_stack(np.unravel_index(at, field.shape)).astype(np.float64) for at in (start, end)]
    # Outside of the volume nothing is above the iso-value: there the surface lies on the outermost nodes.
    outer = ((end_nodes[1] == 0) | (end_nodes[1] == shape - 1)).any(axis=1)
    fraction = np.clip(np.where(outer, 0.0, fraction), MIN_FRACTION, 1.0 - MIN_FRACTION)[:, np.newaxis]
    vertices = (end_nodes[0] + fraction * (end_nodes[1] - end_nodes[0]) - 1.0) * spacing
    return TriangleMesh(vertices, inverse.reshape(-1, 3).astype(np.int32))


def _tetrahedra(inside: Flags) -> Ints:
    """(cells, 6, 4) places in the flat array: the tetrahedra of the cells that the surface passes."""
    shape = inside.shape
    low = np.ones(tuple(n - 1 for n in shape), bool)
    high = np.zeros_like(low)
    for corner in np.ndindex(2, 2, 2):
        corner_inside = inside[tuple(slice(c, n - 1 + c) for c, n in zip(corner, shape, strict=True))]
        low &= corner_inside
        high |= corner_inside
    cells = np.ravel_multi_index(np.nonzero(high & ~low), shape)
    steps = np.array([shape[1] * shape[2], shape[2], 1])
    nodes: Ints = cells[:, np.newaxis, np.newaxis] + TETRAHEDRA @ steps
    return nodes


def _triangles(nodes: Ints, inside: Flags) -> Ints:
    """(triangles, 3, 2) nodes, the inner one first, of the edges that the triangles join.

    Args:
        nodes: (cells, 6, 4).
        inside: (cells, 6, 4) whether they are.
    """
    code = inside @ (1 << np.arange(4))
    triangles = []
    for number in range(len(TETRAHEDRA)):
        for pattern in range(1, 15):
            which = nodes[code[:, number] == pattern, number]
            triangles += [which[:, edges] for edges in _pattern(number, pattern)]
    return np.concatenate(triangles)


def _pattern(number: int, pattern: int) -> list[Ints]:
    """The triangles in one of the six tetrahedra: (3, 2) corners each, the inner one first.

    Args:
        number: of the tetrahedron.
        pattern: bits of the corners that are inside.
    """
    inner = [k for k in range(4) if pattern >> k & 1]
    outer = [k for k in range(4) if not pattern >> k & 1]
    if len(inner) == 2:
        (a, b), (c, d) = inner, outer
        sides = [[(a, c), (a, d), (b, d)], [(a, c), (b, d), (b, c)]]
    else:
        sides = [[(i, o) for i in inner for o in outer]]
    corners = TETRAHEDRA[number]
    outward = corners[outer].mean(axis=0) - corners[inner].mean(axis=0)
    triangles = []
    for side in sides:
        first, second, third = corners[np.array(side)].mean(axis=1)
        along = np.dot(np.cross(second - first, third - first), outward) > 0.0
        triangles.append(np.array(side if along else side[::-1]))
    return triangles

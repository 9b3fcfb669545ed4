"""Mesh topology: edges, boundary loops, pieces, Euler characteristic, genus."""

from dataclasses import dataclass
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..arrays import Flags, Ints
from ..errors import InvalidInput


@dataclass(frozen=True)
class Topology:
    """The edges of a surface: each lies on one face or on two, which run along it in opposite directions.

    Side k of a face goes from its corner k to the next one; sides are numbered 3·face + k.

    Attributes:
        faces: (faces, 3) rows of vertices.
        edges: (edges, 2) rows of vertices, the lower one first, in ascending order.
        side_edge: (3·faces,) the edge of each side.
        edge_sides: (edges, 2) the sides along each edge; the second is −1 on the boundary.
    """

    faces: Ints
    edges: Ints
    side_edge: Ints
    edge_sides: Ints

    @cached_property
    def on_boundary(self) -> Flags:
        """(edges,) whether there is a face on one side only."""
        alone: Flags = self.edge_sides[:, 1] < 0
        return alone

    @cached_property
    def boundary_loops(self) -> tuple[Ints, ...]:
        """The sides along each boundary, in the order of its faces' corners; the longest loop first."""
        sides = self.edge_sides[self.on_boundary, 0]
        # Where fans of faces touch, two sides leave one vertex, but only one leaves the end of a fan.
        fan = self.fans(~self.on_boundary)
        following = dict(zip(fan[sides].tolist(), sides.tolist(), strict=True))
        left, loops = set(sides.tolist()), []
        while left:
            side = left.pop()
            loop = [side]
            while (side := following[int(fan[side_end(side)])]) in left:
                left.remove(side)
                loop.append(side)
            loops.append(np.array(loop))
        return tuple(sorted(loops, key=len, reverse=True))

    def fans(self, joined: Flags) -> Ints:
        """(3·faces,) the fan of each corner: corners of one vertex that joined edges, (edges,), connect."""
        first, other = self.edge_sides[joined].T
        # Two faces run along their edge in opposite directions: where one starts there, the other ends.
        return components(
            self.faces.size,
            np.concatenate((first, side_end(first))),
            np.concatenate((side_end(other), other)),
        )

    @cached_property
    def pieces(self) -> Ints:
        """(faces,) the number of the connected piece of each face."""
        inner = self.edge_sides[~self.on_boundary] // 3
        return components(len(self.faces), inner[:, 0], inner[:, 1])

    @property
    def euler(self) -> int:
        """Vertices in use − edges + faces."""
        return len(np.unique(self.faces)) - len(self.edges) + len(self.faces)

    @property
    def genus(self) -> int:
        """Handles of all pieces together: (2·pieces − boundaries − Euler characteristic)/2."""
        return (2 * (int(self.pieces.max()) + 1) - len(self.boundary_loops) - self.euler) // 2


@overload
def side_end(side: int) -> int: ...
@overload
def side_end(side: Ints) -> Ints: ...
def side_end(side: int | Ints) -> int | Ints:
    """The corner at the end of a side; a side has the number of the corner at its start."""
    return side - side % 3 + (side + 1) % 3


def side_ends(faces: NDArray[np.integer]) -> tuple[Ints, Ints]:
    """(3·faces,) the vertex where each side starts, and the one where it ends."""
    corners: Ints = np.asarray(faces, np.int64)
    following: Ints = np.roll(corners, -1, axis=1)
    return corners.reshape(-1), following.reshape(-1)


def edges_of(faces: NDArray[np.integer]) -> tuple[Ints, Ints, Ints]:
    """The edges of faces, (faces, 3).

    Returns:
        (edges, 2) vertices of each edge, the lower one first, in ascending order; (3·faces,) the edge of each
        side; (edges,) how many sides each has.
    """
    start, end = side_ends(faces)
    span = int(max(start.max(), end.max())) + 1
    keys, side_edge, count = np.unique(
        np.minimum(start, end) * span + np.maximum(start, end), return_inverse=True, return_counts=True
    )
    return np.column_stack((keys // span, keys % span)), side_edge.ravel(), count


def components(number: int, first: Ints, other: Ints) -> Ints:
    """(number,) labels from 0 of what the links one–other connect."""
    graph = coo_array((np.ones(len(first), np.int8), (first, other)), shape=(number, number))
    labels: Ints = connected_components(graph, directed=False)[1].astype(np.int64)
    return labels


def topology_of(faces: NDArray[np.integer]) -> Topology:
    """The edges of faces that form an oriented surface.

    Args:
        faces: (faces, 3) rows of vertices.

    Raises:
        InvalidInput: where an edge has three faces or more, or two that run along it in the same direction.
    """
    edges, side_edge, count = edges_of(faces)
    if (count > 2).any():
        raise InvalidInput("faces", f"{(count > 2).sum()} edges of three faces or more", "at most two a side")
    order = np.argsort(side_edge, kind="stable")
    first = np.concatenate(([0], np.cumsum(count)[:-1]))
    edge_sides = np.full((len(edges), 2), -1, np.int64)
    edge_sides[:, 0] = order[first]
    edge_sides[count == 2, 1] = order[first[count == 2] + 1]
    start, _ = side_ends(faces)
    pairs = edge_sides[count == 2]
    same = start[pairs[:, 0]] == start[pairs[:, 1]]
    if same.any():
        raise InvalidInput("faces", f"{same.sum()} edges along which both faces run alike", "oriented faces")
    return Topology(np.asarray(faces, np.int64), edges, side_edge, edge_sides)

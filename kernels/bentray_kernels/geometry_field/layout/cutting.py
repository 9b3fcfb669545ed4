"""Cuts of a surface: through its handles, and to the points of strongest shrinkage in the flat layout."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ...arrays import Flags, Floats
from ...meshes.mesh import TriangleMesh
from ...meshes.topology import Topology
from .boundary_joining import joined_boundaries
from .conformal import corner_angles, factor, stiffness
from .handles import edge_graph, edges_between, handle_cut, way_back

# Logarithm of the scale that is as good as none.
MIN_SCALE = 1e-3


@dataclass(frozen=True)
class Cut:
    """A cut that grows as a tree.

    Attributes:
        edges: (edges,) those that are cut.
        vertices: (vertices,) those that the cut or the boundary reaches.
    """

    edges: Flags
    vertices: Flags


@dataclass(frozen=True)
class FarEnd:
    """A vertex that a cut should reach.

    Attributes:
        vertex: its row.
        scale: how much the surface shrinks or grows there if it does not, |u|, the logarithm of the factor.
    """

    vertex: int
    scale: float


class Cutter:
    """Cuts of one connected surface.

    Args:
        mesh: the surface.
        topology: its own.
    """

    def __init__(self, mesh: TriangleMesh, topology: Topology) -> None:
        self.topology = topology
        self.vertices = mesh.vertices
        first, other = topology.edges.T
        self.lengths: Floats = np.linalg.norm(self.vertices[first] - self.vertices[other], axis=1)
        self.graph = edge_graph(topology, self.lengths, len(self.vertices))
        self.angles = corner_angles(self.vertices[topology.faces])

    def first(self) -> Cut:
        """The shortest cut there must be: through all handles, joined with all boundaries.

        A closed surface without handles gets a cut of one vertex, at one of its far ends.
        """
        handles = handle_cut(self.topology, self.lengths)
        edges = joined_boundaries(self.topology, self.lengths, handles)
        reached = np.zeros(len(self.vertices), bool)
        reached[self.topology.edges[edges | self.topology.on_boundary]] = True
        if not reached.any():
            reached[self._far_end()] = True
        return Cut(edges, reached)

    def _far_end(self) -> int:
        any_vertex = int(self.topology.faces[0, 0])
        distance = dijkstra(self.graph, indices=any_vertex)
        return int(np.argmax(np.where(np.isfinite(distance), distance, -1.0)))

    def grown(self, cut: Cut, target: int) -> Cut:
        """The cut and the shortest way from it to a vertex."""
        _, before, _ = dijkstra(
            self.graph, indices=np.flatnonzero(cut.vertices), min_only=True, return_predecessors=True
        )
        path = way_back(target, before)
        edges, vertices = cut.edges.copy(), cut.vertices.copy()
        edges[edges_between(self.topology, path[:-1], path[1:])] = True
        vertices[path] = True
        return Cut(edges, vertices)

    def far_ends(self, cut: Cut) -> Iterator[FarEnd]:
        """Where to cut out to, the most urgent first, as long as there is something to gain.

        Ben-Chen, Gotsman and Bunin, "Conformal flattening by curvature prescription" (2008): the logarithm u
        of the scale is 0 on the cut and, in turn, at each vertex chosen, the one where |u| is largest.
        """
        free = np.zeros(len(self.vertices), bool)
        free[self.topology.faces] = True
        free &= ~cut.vertices
        names = np.flatnonzero(free)
        if len(names) == 0:
            return
        matrix = stiffness(self.topology.faces, self.angles, len(self.vertices))
        solver = factor(matrix[free][:, free])
        total = np.bincount(self.topology.faces.ravel(), self.angles.ravel(), len(self.vertices))
        plain = solver.solve((total - 2.0 * np.pi)[free])
        scale, chosen, pulls = plain, np.empty(0, np.int64), np.empty((0, len(plain)))
        while np.abs(scale).max() > MIN_SCALE:
            chosen = np.append(chosen, np.argmax(np.abs(scale)))
            yield FarEnd(int(names[chosen[-1]]), float(np.abs(scale[chosen[-1]])))
            unit = np.zeros(len(plain))
            unit[chosen[-1]] = 1.0
            pulls = np.vstack((pulls, solver.solve(unit)))
            scale = plain - np.linalg.solve(pulls[:, chosen].T, plain[chosen]) @ pulls

"""Handle cutting: short loops through all handles of a surface."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from ...arrays import Flags, Floats, Ints
from ...meshes.topology import Topology, components

# Vertices from which the loops are tried, spread over the surface; the shortest set of loops counts.
ROOTS = 6


def handle_cut(topology: Topology, lengths: Floats) -> Flags:
    """Edges that open every handle of one connected surface; none where the genus is 0.

    Erickson and Whittlesey, "Greedy optimal homotopy and homology generators" (2005): of the edges outside a
    tree of shortest paths, those that a spanning tree of the faces, longest loops first, does not cross close
    two loops a handle. Holes count as faces.

    Args:
        topology: of the mesh.
        lengths: (edges,).

    Returns:
        (edges,) the edges of the loops, without the dead ends that lead to them.
    """
    loops = 2 * topology.genus
    cut = np.zeros(len(topology.edges), bool)
    if loops == 0:
        return cut
    size = int(topology.edges.max()) + 1
    graph = edge_graph(topology, lengths, size)
    roots = np.unique(topology.faces)
    roots = roots[np.linspace(0, len(roots) - 1, ROOTS).astype(np.int64)]
    distances, before = dijkstra(graph, indices=roots, return_predecessors=True)
    best = np.inf
    for distance, parent in zip(distances, before, strict=True):
        candidate = _loops(topology, lengths, distance, parent)
        if lengths[candidate].sum() < best:
            best, cut = float(lengths[candidate].sum()), candidate
    return cut


def edge_graph(topology: Topology, lengths: Floats, size: int) -> csr_array:
    """The symmetric (size, size) matrix of the edges' lengths."""
    first, other = topology.edges.T
    both = (np.concatenate((first, other)), np.concatenate((other, first)))
    return csr_array((np.concatenate((lengths, lengths)), both), shape=(size, size))


def edges_between(topology: Topology, first: Ints, other: Ints) -> Ints:
    """The edges between pairs of neighbouring vertices."""
    span = int(topology.edges.max()) + 1
    keys = topology.edges[:, 0] * span + topology.edges[:, 1]
    return np.searchsorted(keys, np.minimum(first, other) * span + np.maximum(first, other))


def way_back(end: int, before: NDArray[np.integer]) -> Ints:
    """The vertices from one to the root of its tree, given the vertex before each one; below 0: none."""
    way = [end]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return np.array(way)


def _loops(topology: Topology, lengths: Floats, distance: Floats, parent: Ints) -> Flags:
    edges = topology.edges
    used = np.unique(edges)
    child = used[parent[used] >= 0]
    in_tree = np.zeros(len(edges), bool)
    in_tree[edges_between(topology, child, parent[child].astype(np.int64))] = True
    # A hole is one more face, on the other side of its edges.
    sides = topology.edge_sides // 3
    for number, loop in enumerate(topology.boundary_loops):
        sides[topology.side_edge[loop], 1] = len(topology.faces) + number
    free = np.flatnonzero(~in_tree)
    around = distance[edges[free, 0]] + distance[edges[free, 1]] + lengths[free]
    nodes = len(topology.faces) + len(topology.boundary_loops)
    # Two faces may share several edges: the longest loop first, so that it is the one which is kept.
    order = np.argsort(-around, kind="stable")
    pair = np.sort(sides[free[order]], axis=1)
    _, unique = np.unique(pair[:, 0] * nodes + pair[:, 1], return_index=True)
    tree = minimum_spanning_tree(
        csr_array((-around[order[unique]], (pair[unique, 0], pair[unique, 1])), shape=(nodes, nodes))
    ).tocoo()
    crossed_keys = np.sort(
        np.minimum(tree.row, tree.col).astype(np.int64) * nodes + np.maximum(tree.row, tree.col)
    )
    keys = pair[unique, 0] * nodes + pair[unique, 1]
    crossed = np.zeros(len(edges), bool)
    crossed[free[order[unique[np.isin(keys, crossed_keys)]]]] = True
    cut = np.zeros(len(edges), bool)
    for edge in np.flatnonzero(~in_tree & ~crossed):
        cut[edge] = True
        for end in edges[edge]:
            path = way_back(int(end), parent)
            cut[edges_between(topology, path[:-1], path[1:])] = True
    return _in_one_piece(topology, pruned(topology, cut) & ~topology.on_boundary)


def _in_one_piece(topology: Topology, cut: Flags) -> Flags:
    """A cut less the edges that it takes to keep the surface together.

    Loops that run along holes may part it. Pieces without handles, joined by an edge, have none either.
    """
    inner = ~topology.on_boundary
    faces = topology.edge_sides // 3
    whole = faces[inner & ~cut]
    piece = components(len(topology.faces), whole[:, 0], whole[:, 1])
    number = int(piece.max()) + 1
    across = np.flatnonzero(cut & inner)
    low, other = np.sort(piece[faces[across]], axis=1).T
    apart = np.flatnonzero(low != other)
    keys, first = np.unique(low[apart] * number + other[apart], return_index=True)
    links = csr_array((np.ones(len(keys)), (keys // number, keys % number)), shape=(number, number))
    tree = minimum_spanning_tree(links).tocoo()
    in_tree = np.searchsorted(keys, tree.row.astype(np.int64) * number + tree.col)
    result = cut.copy()
    result[across[apart[first[in_tree]]]] = False
    return result


def pruned(topology: Topology, cut: Flags) -> Flags:
    """A cut without its dead ends."""
    cut = cut.copy()
    while True:
        degree = np.bincount(topology.edges[cut].ravel(), minlength=int(topology.edges.max()) + 1)
        dead = cut & ((degree[topology.edges] == 1).any(axis=1))
        if not dead.any():
            return cut
        cut &= ~dead

"""Short cuts between boundaries, after which a surface without handles is a disk."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from ...arrays import Flags, Floats, Ints
from ...meshes.opening import cut_open
from ...meshes.topology import Topology, topology_of
from .handles import edge_graph, edges_between, way_back


def joined_boundaries(topology: Topology, lengths: Floats, cut: Flags) -> Flags:
    """A cut with short ways between all boundaries that there are after it.

    Mehlhorn, "A faster approximation algorithm for the Steiner problem in graphs" (1988): each vertex belongs
    to the boundary that is nearest; where two meet there is a way between them, and a tree of such ways will
    do. No way touches a boundary but at its ends, so none cuts the surface in two.

    Args:
        topology: of the mesh, in one piece after the cut.
        lengths: (edges,).
        cut: (edges,).
    """
    if not cut.any() and len(topology.boundary_loops) < 2:
        return cut
    opened = cut_open(topology, cut)
    after = topology_of(opened.faces)
    loops = after.boundary_loops
    if len(loops) < 2:
        return cut
    corner = opened.faces.ravel()
    boundary = np.concatenate([corner[loop] for loop in loops])
    loop_of = np.full(len(opened.origin), -1)
    loop_of[boundary] = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
    same = edges_between(topology, *opened.origin[after.edges].T)
    graph = edge_graph(after, lengths[same], len(opened.origin))
    distance, before, source = dijkstra(graph, indices=boundary, min_only=True, return_predecessors=True)
    nearest = loop_of[source]
    result = cut.copy()
    for edge in _tree(nearest[after.edges], distance[after.edges].sum(axis=1) + lengths[same], len(loops)):
        result[same[edge]] = True
        for end in after.edges[edge]:
            path = opened.origin[way_back(int(end), before)]
            result[edges_between(topology, path[:-1], path[1:])] = True
    return result


def _tree(pairs: Ints, costs: Floats, number: int) -> Ints:
    """Which links make the cheapest tree: of (links, 2) ends, (links,) costs and the number of all ends."""
    between = np.flatnonzero(pairs[:, 0] != pairs[:, 1])
    order = between[np.argsort(costs[between], kind="stable")]
    one, other = np.sort(pairs[order], axis=1).T
    # Of the links between the same two ends, the cheapest.
    keys, first = np.unique(one * number + other, return_index=True)
    # A cost of 0 would be no link.
    weights = np.maximum(costs[order[first]], np.finfo(np.float64).tiny)
    links = csr_array((weights, (one[first], other[first])), shape=(number, number))
    tree = minimum_spanning_tree(links).tocoo()
    low, high = np.minimum(tree.row, tree.col), np.maximum(tree.row, tree.col)
    return np.asarray(order[first[np.searchsorted(keys, low.astype(np.int64) * number + high)]])

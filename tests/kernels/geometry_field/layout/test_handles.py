"""Loops through handles: after the cut there is no handle left, and the surface stays in one piece."""

import numpy as np
import pytest

from bentray_kernels.geometry_field.layout.handles import edge_graph, edges_between, handle_cut, pruned
from bentray_kernels.meshes.example_surfaces import sphere, torus
from bentray_kernels.meshes.opening import cut_open
from bentray_kernels.meshes.topology import topology_of

from ...meshes.examples import ball_with_holes, two_handles, without


def lengths_of(surface, topology):
    first, other = topology.edges.T
    return np.linalg.norm(surface.vertices[first] - surface.vertices[other], axis=1)


@pytest.mark.parametrize(
    ("surface", "holes"), [(torus(9, 7), 0), (two_handles(), 0), (without(torus(12, 10), [3, 77]), 2)]
)
def test_the_cut_opens_every_handle(surface, holes):
    topology = topology_of(surface.faces)
    opened = topology_of(cut_open(topology, handle_cut(topology, lengths_of(surface, topology))).faces)
    assert opened.genus == 0
    assert opened.pieces.max() == 0
    assert len(opened.boundary_loops) == holes + 1


def test_the_loops_of_a_torus_are_about_as_short_as_can_be():
    surface = torus(40, 30, 0.3)
    topology = topology_of(surface.faces)
    lengths = lengths_of(surface, topology)
    result = lengths[handle_cut(topology, lengths)].sum()
    # Round the inner rim, and round the tube.
    least = 2.0 * np.pi * (0.7 + 0.3)
    assert 0.95 * least < result < 1.15 * least


@pytest.mark.parametrize("surface", [sphere(6, 6), ball_with_holes()])
def test_without_handles_nothing_is_cut(surface):
    topology = topology_of(surface.faces)
    assert not handle_cut(topology, lengths_of(surface, topology)).any()


def test_dead_ends_are_removed():
    topology = topology_of(torus(6, 5).faces)
    first, other = np.array([0, 5, 10, 1]), np.array([5, 10, 15, 2])
    cut = np.zeros(len(topology.edges), bool)
    cut[edges_between(topology, first, other)] = True
    assert cut.sum() == 4
    assert not pruned(topology, cut).any()
    cut[edges_between(topology, np.array([15, 20, 25]), np.array([20, 25, 0]))] = True
    np.testing.assert_array_equal(np.unique(topology.edges[pruned(topology, cut)]), np.arange(0, 30, 5))


def test_the_graph_has_each_edge_both_ways():
    topology = topology_of(sphere(3, 4).faces)
    graph = edge_graph(topology, np.arange(1.0, len(topology.edges) + 1), 10).toarray()
    np.testing.assert_array_equal(graph, graph.T)
    assert graph[tuple(topology.edges[4])] == 5.0

"""Cuts: through handles, from boundary to boundary, and to where a flat layout would shrink the surface."""

from itertools import islice

import numpy as np
import pytest

from bentray_kernels.geometry_field.layout.boundary_joining import joined_boundaries
from bentray_kernels.geometry_field.layout.cutting import Cutter
from bentray_kernels.geometry_field.layout.handles import edge_graph, edges_between, handle_cut, pruned
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.opening import cut_open
from bentray_kernels.meshes.pieces import pieces_of
from bentray_kernels.meshes.topology import topology_of

from ...meshes.examples import ball_with_holes, flat_patch, mesh, two_handles, without


@pytest.mark.parametrize(
    "surface",
    [
        bumpy_ball(500),
        torus(9, 7),
        two_handles(),
        ball_with_holes(),
        without(torus(12, 10), [3, 77]),
        flat_patch(height=lambda x, y: np.cos(x) * np.sin(y)),
    ],
    ids=["ball", "torus", "two handles", "holes", "torus with holes", "patch"],
)
def test_a_grown_cut_leaves_a_disk(surface):
    topology = topology_of(surface.faces)
    cutter = Cutter(surface, topology)
    cut = cutter.first()
    for end in islice(cutter.far_ends(cut), 5):
        before = cut
        cut = cutter.grown(cut, end.vertex)
        assert (cut.edges >= before.edges).all()
        assert cut.vertices[end.vertex]
        opened = topology_of(cut_open(topology, cut.edges).faces)
        assert (opened.euler, opened.genus, len(opened.boundary_loops)) == (1, 0, 1)


def test_a_cut_takes_the_shortest_way():
    patch = flat_patch(9, 9)
    cutter = Cutter(patch, topology_of(patch.faces))
    cut = cutter.first()
    middle, nearer = 4 * 9 + 4, 4 * 9 + 6
    grown = cutter.grown(cutter.grown(cut, middle), nearer)
    # From the middle four edges to the boundary, and from the other vertex two, whatever the way.
    assert cutter.lengths[grown.edges].sum() == pytest.approx(6.0)


def test_the_first_end_is_the_tip_of_a_spike():
    ball = bumpy_ball(2000)
    tip = int(np.argmax(ball.vertices[:, 0]))
    spiked = ball.vertices.copy()
    near = np.linalg.norm(spiked - spiked[tip], axis=1)
    spiked[:, 0] += 3.0 * np.exp(-((near / 0.25) ** 2))
    cutter = Cutter(mesh(spiked, ball.faces), topology_of(ball.faces))
    first = cutter.first()
    ends = [*np.flatnonzero(first.vertices), *(end.vertex for end in islice(cutter.far_ends(first), 2))]
    assert min(np.linalg.norm(spiked[end] - spiked[tip]) for end in ends) < 0.3


def test_ends_do_not_repeat_and_run_out():
    ball = sphere(6, 7)
    cutter = Cutter(ball, topology_of(ball.faces))
    first = cutter.first()
    listed = list(cutter.far_ends(first))
    ends = [end.vertex for end in listed]
    assert listed[0].scale > 3.0 > listed[-1].scale > 1e-3
    assert 10 < len(ends) == len(set(ends)) < len(ball.vertices)
    assert not set(ends) & set(np.flatnonzero(first.vertices).tolist())


def test_flat_surfaces_need_no_cut_end():
    patch = flat_patch()
    cutter = Cutter(patch, topology_of(patch.faces))
    assert list(cutter.far_ends(cutter.first())) == []
    assert not cutter.first().edges.any()


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


@pytest.mark.parametrize("seed", range(12))
def test_ragged_surfaces_become_disks(seed):
    """Many holes, next to each other and to the handle."""
    random = np.random.default_rng(seed)
    whole = (torus(14, 10), flat_patch(12, 12), ball_with_holes())[seed % 3]
    gone = np.flatnonzero(random.uniform(size=len(whole.faces)) < 0.2)
    piece = pieces_of(without(whole, gone))[0]
    surface = sound(piece.vertices, piece.faces).mesh
    topology = topology_of(surface.faces)
    assert len(topology.boundary_loops) > 3
    lengths = lengths_of(surface, topology)
    cut = joined_boundaries(topology, lengths, handle_cut(topology, lengths))
    opened = topology_of(cut_open(topology, cut).faces)
    assert (opened.euler, opened.genus, len(opened.boundary_loops), opened.pieces.max()) == (1, 0, 1, 0)


def test_the_ways_are_the_shortest():
    """Holes in a row, six, five and three columns apart: each joins the next one."""
    patch = flat_patch(40, 9)
    middle = patch.corners.mean(axis=1)
    gone = [np.argmin(np.linalg.norm(middle - (x, 4.3, 0.0), axis=1)) for x in (10.3, 16.3, 21.3, 24.3)]
    surface = without(patch, gone)
    topology = topology_of(surface.faces)
    lengths = lengths_of(surface, topology)
    cut = joined_boundaries(topology, lengths, np.zeros(len(lengths), bool))
    # From a hole up or down to the rim there are four edges, or three: no way is longer than that.
    assert lengths[cut].sum() <= 2 + 4 + 3.5 + 3.5 + 1e-9
    assert cut.sum() > 0


def test_one_boundary_or_none_needs_no_way():
    for surface in (flat_patch(), sphere(5, 5)):
        topology = topology_of(surface.faces)
        cut = np.zeros(len(topology.edges), bool)
        assert joined_boundaries(topology, lengths_of(surface, topology), cut) is cut


def test_a_long_way_is_cut_edge_by_edge():
    """A hole in the middle of a square: only edges of one way to the rim are cut."""
    fine = flat_patch(25, 25)
    hole = np.argmin(np.linalg.norm(fine.corners.mean(axis=1) - (12.4, 12.4, 0.0), axis=1))
    surface = without(fine, [hole])
    topology = topology_of(surface.faces)
    lengths = lengths_of(surface, topology)
    cut = joined_boundaries(topology, lengths, np.zeros(len(lengths), bool))
    ends = topology.edges[cut]
    # The eleven or twelve edges from the hole to the rim are one way: its inner vertices have two of them.
    assert 11 <= cut.sum() <= 12
    assert sorted(np.bincount(ends.ravel())[np.unique(ends)])[:3] == [1, 1, 2]
    assert np.bincount(ends.ravel()).max() == 2

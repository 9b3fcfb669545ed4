"""Boundaries are joined by short ways, and the surface stays whole."""

import numpy as np
import pytest

from bentray_kernels.geometry_field.layout.boundary_joining import joined_boundaries
from bentray_kernels.geometry_field.layout.handles import handle_cut
from bentray_kernels.meshes.defects import sound
from bentray_kernels.meshes.example_surfaces import sphere, torus
from bentray_kernels.meshes.opening import cut_open
from bentray_kernels.meshes.pieces import pieces_of
from bentray_kernels.meshes.topology import topology_of

from ...meshes.examples import ball_with_holes, flat_patch, without


def lengths_of(surface, topology):
    first, other = topology.edges.T
    return np.linalg.norm(surface.vertices[first] - surface.vertices[other], axis=1)


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

"""Opening a mesh along cuts: only the cut edges are separated."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.meshes.example_surfaces import sphere, torus
from bentray_kernels.meshes.opening import cut_open
from bentray_kernels.meshes.topology import topology_of

from .examples import mesh


@given(st.lists(st.booleans(), min_size=96, max_size=96))
def test_any_cut_parts_its_edges_and_keeps_the_others(chosen):
    topology = topology_of(torus(8, 4).faces)
    cut = np.array(chosen)
    meeting = np.bincount(topology.edges[cut].ravel(), minlength=32)
    parted = cut & (meeting[topology.edges] > 1).any(axis=1)
    opened = cut_open(topology, cut)
    np.testing.assert_array_equal(opened.origin[opened.faces], topology.faces)
    after = topology_of(opened.faces)
    assert after.on_boundary.sum() == 2 * parted.sum()
    ends = np.sort(opened.origin[after.edges[~after.on_boundary]], axis=1)
    assert sorted(map(tuple, ends.tolist())) == sorted(map(tuple, topology.edges[~parted].tolist()))


def test_no_cut_changes_nothing_but_parts_touching_fans():
    ball = topology_of(sphere(4, 5).faces)
    assert len(cut_open(ball, np.zeros(len(ball.edges), bool)).origin) == ball.faces.max() + 1
    bowtie = topology_of(mesh(np.zeros((5, 3)), [(0, 1, 2), (0, 3, 4)]).faces)
    assert len(cut_open(bowtie, np.zeros(6, bool)).origin) == 6


def test_a_path_makes_one_boundary_of_both_its_sides():
    topology = topology_of(sphere(6, 8).faces)
    cut = np.zeros(len(topology.edges), bool)
    # Down one meridian: vertices of the circles lie eight apart.
    for ring in range(4):
        cut |= (topology.edges == (8 * ring, 8 * ring + 8)).all(axis=1)
    opened = topology_of(cut_open(topology, cut).faces)
    assert (opened.euler, [len(loop) for loop in opened.boundary_loops]) == (1, [8])

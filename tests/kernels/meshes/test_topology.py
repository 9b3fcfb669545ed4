"""Edges, boundaries, pieces, genus."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.topology import edges_of, side_end, topology_of

from .examples import ball_with_holes, flat_patch, tetrahedron, two_handles, without


@pytest.mark.parametrize(
    ("surface", "euler", "genus", "holes"),
    [
        (tetrahedron(), 2, 0, 0),
        (sphere(5, 6), 2, 0, 0),
        (torus(7, 5), 0, 1, 0),
        (two_handles(), -2, 2, 0),
        (flat_patch(), 1, 0, 1),
        (ball_with_holes(), 0, 0, 2),
        (without(torus(9, 9), [0, 40]), -2, 1, 2),
    ],
)
def test_invariants(surface, euler, genus, holes):
    topology = topology_of(surface.faces)
    assert (topology.euler, topology.genus, len(topology.boundary_loops)) == (euler, genus, holes)


@given(st.integers(2, 6), st.integers(3, 7), st.data())
def test_a_hole_for_each_face_taken_out(rings, around, data):
    """Faces without a common corner: each leaves a loop of its three sides, run the other way round."""
    whole = sphere(rings, around)
    gone: list[int] = []
    for face in data.draw(st.lists(st.integers(0, len(whole.faces) - 1), max_size=4)):
        if not np.isin(whole.faces[face], whole.faces[gone]).any():
            gone.append(face)
    topology = topology_of(np.delete(whole.faces, gone, axis=0)) if len(gone) < len(whole.faces) else None
    assert topology is not None
    assert (topology.genus, len(topology.boundary_loops)) == (0, len(gone))
    result = {frozenset(topology.faces.ravel()[loop].tolist()) for loop in topology.boundary_loops}
    assert result == {frozenset(whole.faces[face].tolist()) for face in gone}


def test_sides_and_edges_refer_to_each_other():
    topology = topology_of(torus(5, 4).faces)
    start, end = topology.faces.ravel(), topology.faces.ravel()[side_end(np.arange(topology.faces.size))]
    np.testing.assert_array_equal(
        topology.edges[topology.side_edge], np.sort(np.column_stack((start, end)), axis=1)
    )
    first, other = topology.edge_sides.T
    np.testing.assert_array_equal(start[first], end[other])
    np.testing.assert_array_equal(topology.side_edge[first], np.arange(len(topology.edges)))


def test_boundary_loops_follow_the_faces_and_the_longest_is_first():
    holed = ball_with_holes()
    topology = topology_of(holed.faces)
    for loop in topology.boundary_loops:
        start = topology.faces.ravel()
        np.testing.assert_array_equal(start[side_end(loop)], np.roll(start[loop], -1))
    lengths = [len(loop) for loop in topology.boundary_loops]
    assert lengths == sorted(lengths, reverse=True)


def test_touching_fans_have_loops_of_their_own():
    bowtie = np.array([(0, 1, 2), (0, 3, 4)])
    topology = topology_of(bowtie)
    assert [len(loop) for loop in topology.boundary_loops] == [3, 3]
    assert topology.pieces.tolist() == [0, 1]
    assert topology.fans(~topology.on_boundary).max() + 1 == 6


@pytest.mark.parametrize(
    ("faces", "words"),
    [
        ([(0, 1, 2), (1, 0, 3), (0, 1, 4)], "1 edges of three faces"),
        ([(0, 1, 2), (0, 1, 3)], "1 edges along which both faces run alike"),
    ],
)
def test_rejects_non_oriented_surfaces(faces, words):
    with pytest.raises(InvalidInput, match=words):
        topology_of(np.array(faces))


def test_edges_are_counted():
    edges, side_edge, count = edges_of(np.array([(0, 1, 2), (1, 0, 3)]))
    assert edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3]]
    assert count.tolist() == [2, 1, 1, 1, 1]
    assert side_edge.tolist() == [0, 3, 1, 0, 2, 4]


def test_large_meshes_have_the_numbers_of_euler():
    ball = bumpy_ball(20_000)
    topology = topology_of(ball.faces)
    assert len(topology.edges) == 3 * len(ball.faces) // 2
    assert topology.euler == 2

"""Meshes: edges, boundaries, pieces, genus, opening along cuts, normals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_kernels.meshes.opening import cut_open
from bentray_kernels.meshes.pieces import pieces_of
from bentray_kernels.meshes.topology import edges_of, side_end, topology_of

from .examples import ball_with_holes, flat_patch, mesh, tetrahedron, two_handles, without


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


def test_pieces_come_apart_the_largest_first():
    parts = [tetrahedron(), flat_patch(9, 9), sphere(4, 5)]
    count = np.cumsum([0, *(len(part.vertices) for part in parts)])
    whole = mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + first for part, first in zip(parts, count, strict=False)]),
    )
    pieces = pieces_of(whole)
    for piece, part in zip(pieces, [parts[1], parts[2], parts[0]], strict=True):
        np.testing.assert_array_equal(piece.vertices, part.vertices)
        np.testing.assert_array_equal(piece.faces, part.faces)


def test_touching_fans_are_two_pieces():
    assert [len(piece.vertices) for piece in pieces_of(mesh(np.eye(5)[:, :3], [(0, 1, 2), (0, 3, 4)]))] == [
        3,
        3,
    ]


def test_normals_of_vertices_are_of_length_one_and_0_without_a_face():
    solid = tetrahedron()
    lonely = TriangleMesh(np.concatenate((3.0 * solid.vertices, [[9.0, 9.0, 9.0]])), solid.faces)
    normals = lonely.vertex_normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), [1.0, 1.0, 1.0, 1.0, 0.0], atol=1e-12)
    # By symmetry; the faces at the origin have equal areas.
    np.testing.assert_allclose(normals[0], np.full(3, -1.0 / np.sqrt(3.0)), atol=1e-12)


def test_the_longest_side_of_the_unit_cube_is_filled_and_the_others_are_in_its_middle():
    box = np.array([[2.0, -3.0, 5.0], [6.0, -1.0, 6.0], [3.0, -2.0, 5.5]])
    moved = TriangleMesh(box, np.array([[0, 1, 2]], np.int32)).in_unit_cube().vertices
    np.testing.assert_allclose([moved.min(axis=0), moved.max(axis=0)], [[0, 0.25, 0.375], [1, 0.75, 0.625]])

"""Triangle meshes: normals of vertices, and the move into the unit cube."""

import numpy as np

from bentray_kernels.meshes.mesh import TriangleMesh

from .examples import tetrahedron


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

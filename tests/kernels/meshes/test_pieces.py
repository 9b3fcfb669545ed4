"""Pieces of a mesh, apart and whole."""

import numpy as np

from bentray_kernels.meshes.example_surfaces import sphere
from bentray_kernels.meshes.pieces import pieces_of

from .examples import flat_patch, mesh, tetrahedron


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

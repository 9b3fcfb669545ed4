"""Triangle meshes, and their charts on the unit square."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats

Faces = NDArray[np.int32]


@dataclass(frozen=True)
class TriangleMesh:
    """Flat triangles that share corners; their corners run counter-clockwise seen from outside.

    Attributes:
        vertices: (vertices, 3), any unit.
        faces: (faces, 3) rows of ``vertices``.
    """

    vertices: Floats
    faces: Faces

    @cached_property
    def corners(self) -> Floats:
        """(faces, 3 corners, 3), in the unit of the vertices."""
        return self.vertices[self.faces]

    @cached_property
    def face_normals(self) -> Floats:
        """(faces, 3) outward, as long as the triangle's area."""
        first, second, third = np.moveaxis(self.corners, 1, 0)
        return 0.5 * np.cross(second - first, third - first)

    @cached_property
    def vertex_normals(self) -> Floats:
        """(vertices, 3) unit vectors: face normals weighted by their area; 0 for a vertex of no face."""
        total: Floats = np.zeros_like(self.vertices)
        for corner in range(3):
            np.add.at(total, self.faces[:, corner], self.face_normals)
        length: Floats = np.linalg.norm(total, axis=1, keepdims=True)
        unit: Floats = total / np.where(length > 0.0, length, 1.0)
        return unit

    def in_unit_cube(self) -> TriangleMesh:
        """Moved, and scaled alike along all axes: the longest side of its box is 1, the box's middle ½."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        return TriangleMesh((self.vertices - 0.5 * (low + high)) / (high - low).max() + 0.5, self.faces)


@dataclass(frozen=True)
class Chart:
    """A mesh laid out on the unit square, cut open where it has to be.

    Attributes:
        mesh: in the unit cube; not cut.
        uv: (faces, 3 corners, 2) in [0, 1]; at a cut the faces on its two sides have corners of their own.
    """

    mesh: TriangleMesh
    uv: Floats

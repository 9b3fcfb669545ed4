"""Conformal flattening of a disk-like mesh with prescribed boundary curvature.

Sawhney and Crane, "Boundary first flattening" (2017). With A the stiffness matrix of linear elements (the
cotangent Laplacian, positive), a metric scaled by e^2u is flat where A·u = −K inside, K the angle defect, and
turns by k̃ = k + (A·u) at the boundary, k the turning there now.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from ...arrays import Flags, Floats, Ints
from ...meshes.opening import OpenMesh
from ...meshes.topology import topology_of

# Least sine of a corner that counts in the stiffness: slivers would make it infinite.
MIN_SINE = 1e-8


@dataclass(frozen=True)
class Disk:
    """A connected mesh with one boundary and no handle, and what its flat layouts share.

    Attributes:
        vertices: (vertices, 3), any unit.
        faces: (faces, 3).
        angles: (faces, 3) of the corners, rad.
    """

    vertices: Floats
    faces: Ints
    angles: Floats

    @classmethod
    def from_mesh(cls, vertices: Floats, opened: OpenMesh) -> Disk:
        """A mesh after its cut."""
        points = vertices[opened.origin]
        return cls(points, opened.faces, corner_angles(points[opened.faces]))

    @cached_property
    def boundary(self) -> Ints:
        """The vertices along the boundary, counter-clockwise seen from outside."""
        (loop,) = topology_of(self.faces).boundary_loops
        return self.faces.ravel()[loop]

    @cached_property
    def inside(self) -> Flags:
        """(vertices,) whether a vertex is off the boundary."""
        inside = np.ones(len(self.vertices), bool)
        inside[self.boundary] = False
        return inside

    @cached_property
    def stiffness(self) -> csc_array:
        """(vertices, vertices)."""
        return stiffness(self.faces, self.angles, len(self.vertices))

    @cached_property
    def turning(self) -> Floats:
        """(vertices,) 2π less the angles about an inner vertex, at the boundary π less them, rad."""
        total = np.bincount(self.faces.ravel(), self.angles.ravel(), len(self.vertices))
        return np.where(self.inside, 2.0 * np.pi, np.pi) - total

    @cached_property
    def side_lengths(self) -> Floats:
        """(boundary,) from each vertex of the boundary to the next, in the unit of the vertices."""
        points = self.vertices[self.boundary]
        return np.asarray(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1))

    @cached_property
    def _dirichlet(self) -> tuple[SuperLU, csc_array]:
        rows = self.stiffness[self.inside]
        return factor(rows[:, self.inside]), rows[:, ~self.inside]

    @cached_property
    def _neumann(self) -> SuperLU:
        return factor(self.stiffness[1:, 1:])

    def extended(self, values: Floats) -> Floats:
        """Harmonic inside: values of the vertices, (vertices, k), of which those of the boundary stay."""
        result = values.copy()
        if not self.inside.any():
            return result
        solver, border = self._dirichlet
        result[self.inside] = solver.solve(-(border @ values[~self.inside]))
        return result

    @cached_property
    def isometric_turning(self) -> Floats:
        """(boundary,) how the boundary turns in the flat layout that keeps its lengths, rad; 2π together.

        Of all conformal maps this one has the least spread of scale (Springborn, Schröder and Pinkall 2008).
        """
        scale = np.zeros(len(self.vertices))
        if self.inside.any():
            solver, _ = self._dirichlet
            scale[self.inside] = solver.solve(-self.turning[self.inside])
        return np.asarray((self.turning + self.stiffness @ scale)[self.boundary])

    def round_turning(self) -> Floats:
        """(boundary,) how a circle of the boundary's lengths turns, rad."""
        lengths = self.side_lengths
        share = lengths + np.roll(lengths, 1)
        return np.asarray(2.0 * np.pi * share / share.sum())

    def layout(self, turning: Floats) -> Floats:
        """The flat layout with the given boundary turning.

        Args:
            turning: (boundary,) rad, 2π together.

        Returns:
            (vertices, 2), about as large as the mesh.
        """
        source = -self.turning
        source[self.boundary] += turning
        # Inside −K remains, at the boundary k̃ − k.
        scale = np.concatenate(([0.0], self._neumann.solve(source[1:])))[self.boundary]
        # Of needles the layout is no number; who draws it leaves it then.
        with np.errstate(over="ignore", invalid="ignore"):
            lengths = self.side_lengths * np.exp(0.5 * (scale + np.roll(scale, -1)))
            return self._drawn(turning, lengths * (self.side_lengths.sum() / lengths.sum()))

    def isometric_layout(self) -> Floats:
        """The flat layout that keeps the lengths of the boundary, (vertices, 2), without a second solver."""
        return self._drawn(self.isometric_turning, self.side_lengths)

    def _drawn(self, turning: Floats, lengths: Floats) -> Floats:
        plane = np.zeros((len(self.vertices), 2))
        plane[self.boundary] = closed_curve(turning, lengths, self.side_lengths)
        return self.extended(plane)


def closed_curve(turning: Floats, lengths: Floats, weights: Floats) -> Floats:
    """Corners of a closed polygon with the given turning and the least change of its sides.

    Args:
        turning: (n,) rad at each corner.
        lengths: (n,) of the sides from each corner to the next.
        weights: (n,) how much a side may give.

    Returns:
        (n, 2).
    """
    direction = np.cumsum(turning)
    along = np.stack((np.cos(direction), np.sin(direction)))
    give = weights * along
    lengths = lengths - give.T @ np.linalg.solve(give @ along.T, along @ lengths)
    steps = (along * lengths).T
    return np.asarray(np.cumsum(steps, axis=0) - steps)


def corner_angles(corners: Floats) -> Floats:
    """(faces, 3) rad, of (faces, 3 corners, 3)."""
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    sine = np.linalg.norm(np.cross(ahead, behind), axis=-1)
    return np.asarray(np.arctan2(sine, (ahead * behind).sum(axis=-1)))


def stiffness(faces: Ints, angles: Floats, size: int) -> csc_array:
    """Linear elements' stiffness: half the cotangents of the angles opposite to each edge.

    Args:
        faces: (faces, 3).
        angles: (faces, 3) rad.
        size: number of vertices.
    """
    weight = (0.5 * np.cos(angles) / np.maximum(np.sin(angles), MIN_SINE)).ravel()
    first, other = np.roll(faces, -1, axis=1).ravel(), np.roll(faces, -2, axis=1).ravel()
    rows = np.concatenate((first, other, first, other))
    columns = np.concatenate((other, first, first, other))
    values = np.concatenate((-weight, -weight, weight, weight))
    return csc_array((values, (rows, columns)), shape=(size, size))


def factor(matrix: csc_array) -> SuperLU:
    """Factors of a symmetric positive definite matrix: pivots on the diagonal, least degree first."""
    return splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )

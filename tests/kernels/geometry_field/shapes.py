"""Meshes with trivial charts, and fields of them, for the tests of the geometry field."""

import numpy as np

from bentray_kernels.geometry_field.tables.inner_field import (
    InnerField,
    build_inner_rows,
    inner_field,
    spread_points,
)
from bentray_kernels.geometry_field.tables.outer_field import OuterField, build_rows, outer_field
from bentray_kernels.meshes.mesh import Chart, TriangleMesh
from bentray_kernels.meshes.surface import Surface, surface_of


def octahedron(levels: int) -> TriangleMesh:
    """A ball of radius ½ about the middle of the unit cube: each face of an octahedron in 4 ** levels."""
    vertices = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(levels):
        pairs = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, position = np.unique(pairs, axis=0, return_inverse=True)
        middles = vertices[edges].sum(axis=1)
        a, b, c = (len(vertices) + position.reshape(-1, 3)).T
        p, q, r = faces.T
        faces = np.concatenate([np.stack(t, axis=1) for t in ((p, a, c), (a, q, b), (c, b, r), (a, b, c))])
        vertices = np.concatenate([vertices, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
    return TriangleMesh(0.5 * vertices + 0.5, faces.astype(np.int32))


def dented(levels: int, depth: float = 0.55) -> TriangleMesh:
    """A ball with a dent from above, so that it sees itself."""
    ball = octahedron(levels)
    away = 2.0 * ball.vertices - 1.0
    pressed = depth * np.exp(-(away[:, 0] ** 2 + away[:, 1] ** 2) / 0.18) * (away[:, 2] > 0.0)
    away[:, 2] *= 1.0 - pressed
    return TriangleMesh(0.5 * away + 0.5, ball.faces).in_unit_cube()


def turned(mesh: TriangleMesh) -> TriangleMesh:
    """Along none of the axes, so that no sample's ray just touches an edge."""
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    return TriangleMesh(mesh.vertices @ rotation.T, mesh.faces).in_unit_cube()


def over_the_poles(mesh: TriangleMesh) -> Chart:
    """Longitude and latitude of each corner; a face over the date line keeps its corners together."""
    away = mesh.corners - 0.5
    u = np.arctan2(away[..., 1], away[..., 0]) / (2.0 * np.pi) + 0.5
    wide = u.max(axis=1) - u.min(axis=1) > 0.5
    u[wide] = np.where(u[wide] < 0.5, 1.0, u[wide])
    v = np.arccos(np.clip(away[..., 2] / np.linalg.norm(away, axis=-1), -1.0, 1.0)) / np.pi
    return Chart(mesh, np.stack([u, v], axis=-1))


def random_triangles(seed: int, count: int) -> Chart:
    """Triangles that share nothing, anywhere in the unit cube; each over all of the square."""
    corners = np.random.default_rng(seed).random((3 * count, 3))
    mesh = TriangleMesh(corners, np.arange(3 * count, dtype=np.int32).reshape(-1, 3))
    return Chart(mesh, np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (count, 1, 1)))


def ball(levels: int = 3) -> Surface:
    return surface_of(over_the_poles(octahedron(levels)))


def field_of(surface: Surface, n: int) -> OuterField:
    """The whole outer field, as one batch."""
    return outer_field(n, [build_rows(surface, n, 0, 6 * n * n)])


def inner_of(surface: Surface, n: int, divisions: int) -> InnerField:
    """The whole inner field, as one batch."""
    points, starts = spread_points(surface, divisions)
    return inner_field(n, starts, [build_inner_rows(surface, n, points)])

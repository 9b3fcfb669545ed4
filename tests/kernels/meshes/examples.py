"""Meshes that tests share."""

from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.meshes.example_surfaces import bumpy_ball, sphere, torus
from bentray_kernels.meshes.mesh import TriangleMesh

BUNNY = Path(__file__).parents[4] / "shared" / "data" / "bunny.off"


def mesh(vertices, faces):
    return TriangleMesh(np.array(vertices, np.float64), np.array(faces, np.int32))


def tetrahedron():
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    return mesh(corners, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


def flat_patch(nx=7, ny=5, height=lambda x, y: 0.0 * x):
    """A rectangle nx − 1 by ny − 1 in the plane, or a height field over it, seen from above."""
    x, y = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    number = np.arange(nx * ny).reshape(nx, ny)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))])
    return mesh(np.column_stack((x.ravel(), y.ravel(), height(x, y).ravel())), faces)


def two_handles():
    """Two rings joined by a tube of triangles between two triangular holes: genus 2."""
    first, other = torus(12, 8), torus(12, 8)
    count = len(first.vertices)
    vertices = np.concatenate((first.vertices, other.vertices + np.array((2.9, 0.0, 0.0))))
    # The outermost face of the first ring and the one that faces it on the second.
    middle = vertices[first.faces].mean(axis=1)
    right = int(np.argmax(middle[:, 0]))
    left = int(np.argmin(vertices[other.faces + count].mean(axis=1)[:, 0]))
    hole, opposite = first.faces[right], other.faces[left] + count
    faces = [np.delete(first.faces, right, 0), np.delete(other.faces, left, 0) + count]
    # The corners of the one run against those of the other.
    pairs = min(
        (np.roll(opposite[::-1], k) for k in range(3)),
        key=lambda turned: np.linalg.norm(vertices[hole] - vertices[turned], axis=1).sum(),
    )
    for k in range(3):
        a, b, c, d = hole[k], hole[(k + 1) % 3], pairs[k], pairs[(k + 1) % 3]
        faces += [np.array([(a, b, d)]), np.array([(a, d, c)])]
    return mesh(vertices, np.concatenate(faces))


def without(whole, gone):
    """The mesh less some faces."""
    return TriangleMesh(whole.vertices, np.delete(whole.faces, gone, axis=0))


def ball_with_holes():
    """A ball of 720 faces with two holes in places far from each other."""
    whole = bumpy_ball(720)
    height = whole.corners.mean(axis=1)[:, 2]
    return without(whole, np.flatnonzero(np.abs(height) > 0.85))


def bunny():
    if not BUNNY.exists():
        pytest.skip(f"NOT CHECKED: {BUNNY} is absent")
    words = BUNNY.read_text().split()
    vertices, faces = int(words[1]), int(words[2])
    numbers = np.array(words[4:], np.float64)
    points, rows = numbers[: 3 * vertices], numbers[3 * vertices :]
    return mesh(points.reshape(-1, 3), rows.reshape(faces, 4)[:, 1:])


def volume_of(surface):
    first, second, third = np.moveaxis(surface.corners, 1, 0)
    return (first * np.cross(second, third)).sum() / 6.0


SURFACES = {
    "sphere": sphere(),
    "torus": torus(40, 40),
    "two handles": two_handles(),
    "ball": bumpy_ball(5000),
    "holes": ball_with_holes(),
    "torus with holes": without(torus(30, 30), [5, 300, 900]),
    "patch": flat_patch(9, 9, lambda x, y: np.sin(0.4 * x) * np.cos(0.3 * y)),
}

"""Example meshes: a sphere, a torus, and a bumpy ball with any number of faces."""

import math

import numpy as np

from ..arrays import Floats, Ints
from ..errors import InvalidInput
from .mesh import TriangleMesh

# Waves of the bumpy ball: direction and number per unit of length, height as part of the radius.
WAVES = (
    ((0.9, 0.3, 0.2), 2.0, 0.12),
    ((-0.2, 0.8, 0.5), 4.0, 0.06),
    ((0.4, -0.5, 0.7), 7.0, 0.03),
    ((0.1, 0.6, -0.8), 12.0, 0.012),
)


def sphere(rings: int = 32, around: int = 31) -> TriangleMesh:
    """The unit sphere between circles of latitude, 2·around·(rings − 1) faces: 1,922 as in Table 5.

    Args:
        rings: strips from pole to pole, 2 or more.
        around: vertices of each circle, 3 or more.

    Raises:
        InvalidInput: for fewer.
    """
    if rings < 2 or around < 3:
        raise InvalidInput("rings, around", f"{rings}, {around}", "2 and 3 or more")
    polar = np.pi * np.arange(1, rings) / rings
    azimuth = 2.0 * np.pi * np.arange(around) / around
    circles = np.stack(
        (
            np.outer(np.sin(polar), np.cos(azimuth)),
            np.outer(np.sin(polar), np.sin(azimuth)),
            np.outer(np.cos(polar), np.ones(around)),
        ),
        axis=-1,
    )
    poles = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    numbers = np.arange(circles[..., 0].size).reshape(rings - 1, around)
    north = np.full(around, numbers.size)
    upper, lower = numbers[0], numbers[-1]
    caps = [
        np.column_stack((north, upper, np.roll(upper, -1))),
        np.column_stack((north + 1, np.roll(lower, -1), lower)),
    ]
    faces = np.concatenate([*caps, _strips(numbers, False)])
    return TriangleMesh(np.concatenate((circles.reshape(-1, 3), poles)), faces.astype(np.int32))


def torus(along: int = 63, around: int = 63, thickness: float = 0.4) -> TriangleMesh:
    """A ring of radius 1 about the z axis, 2·along·around faces: 7,938 as in Table 5.

    Args:
        along: vertices along the ring, 3 or more.
        around: vertices about its core, 3 or more.
        thickness: radius of the tube, between 0 and 1.

    Raises:
        InvalidInput: for others.
    """
    if along < 3 or around < 3 or not 0.0 < thickness < 1.0:
        raise InvalidInput("torus", f"{along}, {around}, {thickness}", "3 or more, and a radius in (0, 1)")
    turn = (2.0 * np.pi * np.arange(along) / along)[:, np.newaxis]
    roll = 2.0 * np.pi * np.arange(around) / around
    out = 1.0 + thickness * np.cos(roll)
    height = np.broadcast_to(thickness * np.sin(roll), (along, around))
    vertices = np.stack((out * np.cos(turn), out * np.sin(turn), height), axis=-1).reshape(-1, 3)
    numbers = np.arange(along * around).reshape(along, around)
    return TriangleMesh(vertices, _strips(numbers, True).astype(np.int32))


def bumpy_ball(faces: int) -> TriangleMesh:
    """A ball with waves of several lengths, its vertices spread almost evenly.

    Args:
        faces: target number, 20 or more; the result has the nearest 20·n².

    Raises:
        InvalidInput: for fewer.
    """
    if faces < 20:
        raise InvalidInput("faces", faces, "20 or more")
    ball = _geodesic(max(round(math.sqrt(faces / 20.0)), 1))
    radius = np.ones(len(ball.vertices))
    for direction, number, height in WAVES:
        radius += height * np.sin(np.pi * number * (ball.vertices @ np.array(direction)) + number)
    return TriangleMesh(ball.vertices * radius[:, np.newaxis], ball.faces)


def _strips(numbers: Ints, closed: bool) -> Ints:
    """Faces between neighbouring rows of vertices, each row a circle; and between the last and the first."""
    ahead = np.roll(numbers, -1, axis=0) if closed else numbers[1:]
    here = numbers if closed else numbers[:-1]
    a, b, c, d = here, ahead, np.roll(ahead, -1, axis=1), np.roll(here, -1, axis=1)
    faces: Ints = np.concatenate((np.stack((a, b, c), axis=-1), np.stack((a, c, d), axis=-1))).reshape(-1, 3)
    return faces


def _geodesic(divisions: int) -> TriangleMesh:
    """The unit sphere as an icosahedron, each edge in so many parts."""
    corners, base = _icosahedron()
    steps = [(i, j) for i in range(divisions + 1) for j in range(divisions + 1 - i)]
    number = {step: k for k, step in enumerate(steps)}
    upright = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in steps if i + j < divisions]
    turned = [
        (number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in steps if i + j < divisions - 1
    ]
    inner = np.array(upright + turned)
    share = np.array([(divisions - i - j, i, j) for i, j in steps]) / divisions
    points = (share[np.newaxis, ..., np.newaxis] * corners[base][:, np.newaxis]).sum(axis=2).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    faces = (inner + len(steps) * np.arange(len(base))[:, np.newaxis, np.newaxis]).reshape(-1, 3)
    # The faces of the icosahedron share the vertices along their edges.
    _, first, shared = np.unique(
        np.round(points * 1e9).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    return TriangleMesh(points[first], shared.ravel()[faces].astype(np.int32))


def _icosahedron() -> tuple[Floats, Ints]:
    """(12, 3) corners and (20, 3) faces, counter-clockwise seen from outside."""
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    signs = [(a, b) for a in (-1.0, 1.0) for b in (-golden, golden)]
    corners = np.array(
        [(0.0, a, b) for a, b in signs] + [(a, b, 0.0) for a, b in signs] + [(b, 0.0, a) for a, b in signs]
    )
    side = np.linalg.norm(corners[:, np.newaxis] - corners, axis=-1)
    near = np.abs(side - 2.0) < 1e-9
    faces = np.array(
        [
            (i, j, k)
            for i in range(12)
            for j in range(i + 1, 12)
            for k in range(j + 1, 12)
            if near[i, j] and near[j, k] and near[i, k]
        ]
    )
    inward = np.linalg.det(corners[faces]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return corners, faces

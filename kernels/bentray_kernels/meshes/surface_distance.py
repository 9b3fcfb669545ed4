"""Exact distance from points to a surface, by a grid of its triangles."""

import math

import numpy as np

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from .mesh import TriangleMesh

# Cells along the longest side of the box: about as long as three sides of a face, within these bounds.
MIN_CELLS, MAX_CELLS = 4, 128


class SurfaceGrid:
    """Triangles sorted into a grid, for the distance of many points.

    Efficient for points near the surface: a far one visits all cells between.

    Args:
        mesh: with one face at least.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self._corners = np.ascontiguousarray(mesh.corners)
        low, high = self._corners.min(axis=(0, 1)), self._corners.max(axis=(0, 1))
        cells = min(max(math.isqrt(len(mesh.faces)) // 3, MIN_CELLS), MAX_CELLS)
        self._step = float(max((high - low).max() / cells, np.finfo(float).tiny))
        self._low = low
        self._shape = np.maximum(np.ceil((high - low) / self._step).astype(np.int64), 1)
        self._start, self._faces = _sorted(self._corners, low, self._step, self._shape)

    def distance(self, points: Floats) -> Floats:
        """(points,) to the nearest point of the surface, of (points, 3), in their unit."""
        result: Floats = _distances(
            np.ascontiguousarray(points, np.float64),
            self._corners,
            self._low,
            self._step,
            self._shape,
            self._start,
            self._faces,
        )
        return result


@kernel(inline="always")
def _cell(place: float, low: float, step: float, number: int) -> int:
    return min(max(int((place - low) / step), 0), number - 1)


@kernel
def _sorted(corners: Floats, low: Floats, step: float, shape: Ints) -> tuple[Ints, Ints]:
    """First entry of each cell, and the faces whose boxes touch it."""
    start = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    faces = np.empty(0, np.int64)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for turn in range(2):
        for f in range(len(corners)):
            for axis in range(3):
                a, b, c = corners[f, 0, axis], corners[f, 1, axis], corners[f, 2, axis]
                first[axis] = _cell(min(a, b, c), low[axis], step, shape[axis])
                last[axis] = _cell(max(a, b, c), low[axis], step, shape[axis])
            for i in range(first[0], last[0] + 1):
                for j in range(first[1], last[1] + 1):
                    for k in range(first[2], last[2] + 1):
                        cell = (i * shape[1] + j) * shape[2] + k
                        if turn == 0:
                            start[cell + 1] += 1
                        else:
                            # Each cell is filled from its end; so the starts are right afterwards.
                            start[cell + 1] -= 1
                            faces[start[cell + 1]] = f
        if turn == 0:
            start = np.cumsum(start)
            faces = np.empty(start[-1], np.int64)
    return np.append(start[1:], len(faces)), faces


@kernel
def _distances(
    points: Floats, corners: Floats, low: Floats, step: float, shape: Ints, start: Ints, faces: Ints
) -> Floats:
    result = np.empty(len(points))
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        ci, cj, ck = (
            _cell(x, low[0], step, shape[0]),
            _cell(y, low[1], step, shape[1]),
            _cell(z, low[2], step, shape[2]),
        )
        best = math.inf
        # From a point outside of the box, the cells of ring r are at least as far as from its nearest place.
        for ring in range(max(shape[0], shape[1], shape[2])):
            if best <= ((ring - 1) * step) ** 2 and ring > 0:
                break
            for i in range(max(ci - ring, 0), min(ci + ring, shape[0] - 1) + 1):
                for j in range(max(cj - ring, 0), min(cj + ring, shape[1] - 1) + 1):
                    hull = abs(i - ci) == ring or abs(j - cj) == ring
                    stride = 1 if hull else max(2 * ring, 1)
                    for k in range(ck - ring, ck + ring + 1, stride):
                        if k < 0 or k >= shape[2]:
                            continue
                        cell = (i * shape[1] + j) * shape[2] + k
                        for entry in range(start[cell], start[cell + 1]):
                            best = min(best, _square_to_triangle(corners, faces[entry], x, y, z))
        result[p] = math.sqrt(best)
    return result


@kernel(inline="always")
def _square_to_triangle(corners: Floats, f: int, x: float, y: float, z: float) -> float:
    """Squared distance: to the plane where the foot lies in the triangle, else to the nearest side."""
    ax, ay, az = corners[f, 0, 0], corners[f, 0, 1], corners[f, 0, 2]
    ux, uy, uz = corners[f, 1, 0] - ax, corners[f, 1, 1] - ay, corners[f, 1, 2] - az
    vx, vy, vz = corners[f, 2, 0] - ax, corners[f, 2, 1] - ay, corners[f, 2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    up, vp = ux * px + uy * py + uz * pz, vx * px + vy * py + vz * pz
    area = uu * vv - uv * uv
    s, t = vv * up - uv * vp, uu * vp - uv * up
    if area > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= area:
        s, t = s / area, t / area
        px, py, pz = px - s * ux - t * vx, py - s * uy - t * vy, pz - s * uz - t * vz
        square: float = px * px + py * py + pz * pz
        return square
    best = _square_to_side(px, py, pz, ux, uy, uz)
    best = min(best, _square_to_side(px, py, pz, vx, vy, vz))
    opposite: float = _square_to_side(px - ux, py - uy, pz - uz, vx - ux, vy - uy, vz - uz)
    return min(best, opposite)


@kernel(inline="always")
def _square_to_side(px: float, py: float, pz: float, x: float, y: float, z: float) -> float:
    """From a point to the segment from 0 to (x, y, z), squared."""
    square = x * x + y * y + z * z
    t = min(max((px * x + py * y + pz * z) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return (px - t * x) ** 2 + (py - t * y) ** 2 + (pz - t * z) ** 2

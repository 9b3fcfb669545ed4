"""Meshes, fields and rays of the geometry field's benchmark."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from bentray_kernels.geometry_field.tables.outer_field import OuterField, build_rows, outer_field
from bentray_kernels.meshes.example_surfaces import bumpy_ball
from bentray_kernels.meshes.mesh import TriangleMesh
from bentray_kernels.meshes.surface import Surface
from bentray_kernels.refraction import perspective

BUNNY = Path(__file__).resolve().parents[3] / "shared" / "data" / "bunny.off"
FACES = 75_408
THREADS, BATCHES = 2, 64


def load_mesh() -> tuple[str, TriangleMesh]:
    """The bunny, or where it is absent a bumpy ball of as many faces."""
    if not BUNNY.is_file():
        return f"bumpy ball, {FACES} faces (no bunny here)", bumpy_ball(FACES).in_unit_cube()
    words = BUNNY.read_text().split()
    vertices, faces = int(words[1]), int(words[2])
    numbers = np.array(words[4:], dtype=float)
    points, corners = numbers[: 3 * vertices].reshape(-1, 3), numbers[3 * vertices :].reshape(faces, 4)[:, 1:]
    return f"bunny, {faces} faces", TriangleMesh(points, corners.astype(np.int32)).in_unit_cube()


def build_outer_field(surface: Surface, n: int) -> OuterField:
    """The outer field, in two threads."""
    ends = np.linspace(0, 6 * n * n, BATCHES + 1).astype(int)
    with ThreadPoolExecutor(THREADS) as pool:
        return outer_field(n, list(pool.map(lambda a, b: build_rows(surface, n, a, b), ends[:-1], ends[1:])))


def incoherent_rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from anywhere on one face of the unit cube to anywhere on another."""
    random = np.random.default_rng(0)
    ends = random.random((2, count, 3))
    first = random.integers(6, size=count)
    for end, face in zip(ends, (first, (first + random.integers(1, 6, size=count)) % 6), strict=True):
        end[np.arange(count), face // 2] = face % 2
    return np.float32(ends[0]), np.float32(ends[1] - ends[0])


def camera_rays(pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays of a picture that the unit cube fills, row by row."""
    camera = perspective((1.1, 0.9, 1.95), (0.5, 0.5, 0.5), (0.0, 1.0, 0.0), 34.0)
    position = (np.arange(pixels) + 0.5) / pixels - 0.5
    u, v = np.tile(position, pixels)[:, None], np.repeat(position, pixels)[:, None]
    ahead = camera.direction[0] + u * camera.direction[1] + v * camera.direction[2]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return np.float32(np.broadcast_to(camera.origin[0], ahead.shape)), np.float32(ahead)


def as_columns(rays: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Rays in the form that lookups take: (3, n), one row an axis."""
    origins, directions = (np.ascontiguousarray(a.T, np.float32) for a in rays)
    return origins, directions

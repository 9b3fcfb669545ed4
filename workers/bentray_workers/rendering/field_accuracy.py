"""Accuracy of lookups in a geometry field against exact intersection, for random rays."""

import numpy as np

from bentray_kernels.geometry_field.tables.accurate_lookup import STEPS, find
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.meshes.intersector import intersect
from bentray_kernels.meshes.surface import Surface

RAYS = 50_000


def accuracy(surface: Surface, field: OuterField) -> dict[str, float]:
    """Compare lookups from the nearest entry with exact intersections, always for the same rays.

    Returns:
        ``lookup_wrong``: share of rays that hit the mesh by only one of the methods. ``lookup_median`` and
        ``lookup_99``: distances between both hits, edges of the cube; 0 if no ray hits the mesh.
    """
    origins, ends = _ends()
    directions = ends - origins
    faces, distances = np.empty(RAYS, np.int32), np.empty(RAYS, np.float32)
    find(
        surface,
        field,
        np.ascontiguousarray(origins.T),
        np.ascontiguousarray(directions.T),
        STEPS,
        faces,
        distances,
        np.empty((2, RAYS), np.float32),
    )
    met, exact = np.empty(RAYS, np.int32), np.empty(RAYS)
    nowhere = np.full(RAYS, -1, np.int32)
    rays = origins.astype(np.float64), directions.astype(np.float64)
    intersect(surface, *rays, nowhere, met, exact, np.empty((RAYS, 2)), np.empty(RAYS, bool))
    both = (faces >= 0) & (met >= 0)
    off = np.abs(distances[both] - exact[both]) * np.linalg.norm(rays[1][both], axis=1)
    off = off if len(off) else np.zeros(1)
    return {
        "lookup_wrong": float(((faces >= 0) != (met >= 0)).mean()),
        "lookup_median": float(np.median(off)),
        "lookup_99": float(np.quantile(off, 0.99)),
    }


def _ends() -> tuple[np.ndarray, np.ndarray]:
    """(rays, 3) float32 places on one face of the unit cube and on another one."""
    random = np.random.default_rng(0)
    points = random.random((2, RAYS, 3), dtype=np.float32)
    first = random.integers(6, size=RAYS)
    for point, face in zip(points, (first, (first + random.integers(1, 6, size=RAYS)) % 6), strict=True):
        point[np.arange(RAYS), face // 2] = face % 2
    return points[0], points[1]

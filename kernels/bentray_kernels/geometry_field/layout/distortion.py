"""Distortion of flat layouts: area, shape, flipped triangles, overlap."""

import math

import numpy as np

from ...arrays import Floats
from ...compilation.compiled import kernel


def signed_areas(uv: Floats) -> Floats:
    """(faces,) of (faces, 3 corners, 2); negative for a flipped triangle."""
    first, other = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return np.asarray(0.5 * (first[:, 0] * other[:, 1] - first[:, 1] * other[:, 0]))


def quasi_conformal_factors(corners: Floats, uv: Floats) -> Floats:
    """Largest over smallest stretch of each triangle's map; 1 keeps angles, infinity is flat or flipped.

    Args:
        corners: (faces, 3 corners, 3).
        uv: (faces, 3 corners, 2).

    Returns:
        (faces,).
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(first, axis=1)
    double_area = np.linalg.norm(np.cross(first, second), axis=1)
    along_u, other = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    # The derivatives along the first side and at right angles to it, within the triangle.
    along = along_u / length[:, np.newaxis]
    projection = ((first * second).sum(axis=1) / length**2)[:, np.newaxis]
    across = (other - projection * along_u) * (length / double_area)[:, np.newaxis]
    squares = (along**2 + across**2).sum(axis=1)
    area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        half = squares / (2.0 * area)
        ratio = half + np.sqrt(np.maximum(half * half - 1.0, 0.0))
    return np.where(area > 0.0, ratio, np.inf)


def area_stretch(areas: Floats, uv_areas: Floats) -> float:
    """Area of the surface per pixel: root mean square over the surface, relative to the least possible.

    1 where the layout fills the unit square and keeps ratios of areas. Flat pieces between the pixels miss a
    bent surface by its curvature times their area; so the geometric error is about proportional to this.
    (Sander et al., "Texture mapping progressive meshes", 2001, measure lengths in the same way.)

    Args:
        areas: (faces,) of the triangles, any unit.
        uv_areas: (faces,) of their images, in [0, 1]².

    Returns:
        At least 1; infinity where a triangle is flat or flipped.
    """
    if (uv_areas <= 0.0).any():
        return math.inf
    return math.sqrt(float((areas**3 / uv_areas**2).sum() / areas.sum() ** 3))


@kernel
def crosses_itself(polygon: Floats) -> bool:
    """Whether two sides of a closed polygon, (corners, 2), that are no neighbours meet."""
    number = len(polygon)
    # Sides in the order of their lowest x meet only those that begin before they end.
    low, high = np.empty(number), np.empty(number)
    for i in range(number):
        ahead = (i + 1) % number
        low[i] = min(polygon[i, 0], polygon[ahead, 0])
        high[i] = max(polygon[i, 0], polygon[ahead, 0])
    order = np.argsort(low)
    for p in range(number):
        i = order[p]
        for q in range(p + 1, number):
            j = order[q]
            if low[j] > high[i]:
                break
            apart = (i - j) % number
            if apart > 1 and apart < number - 1 and _meet(polygon, i, j):
                return True
    return False


@kernel(inline="always")
def _meet(polygon: Floats, i: int, j: int) -> bool:
    number = len(polygon)
    k, m = (i + 1) % number, (j + 1) % number
    return (_side(polygon, i, k, j) > 0.0) != (_side(polygon, i, k, m) > 0.0) and (
        _side(polygon, j, m, i) > 0.0
    ) != (_side(polygon, j, m, k) > 0.0)


@kernel(inline="always")
def _side(polygon: Floats, i: int, k: int, point: int) -> float:
    side: float = (polygon[k, 0] - polygon[i, 0]) * (polygon[point, 1] - polygon[i, 1]) - (
        polygon[k, 1] - polygon[i, 1]
    ) * (polygon[point, 0] - polygon[i, 0])
    return side

"""Geometric error: symmetric distance between two surfaces."""

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from .mesh import TriangleMesh
from .surface_distance import SurfaceGrid

SAMPLES = 100_000


@dataclass(frozen=True)
class GeometricError:
    """Distances between two surfaces, in the unit of their vertices.

    Attributes:
        rms: root of the mean square, the larger of both ways.
        greatest: the largest distance from any sample, either way.
    """

    rms: float
    greatest: float


def geometric_error(mesh: TriangleMesh, other: TriangleMesh, samples: int = SAMPLES) -> GeometricError:
    """From points spread evenly over each surface to the other (Gu, Gortler and Hoppe 2002, section 5)."""
    ways = [
        SurfaceGrid(there).distance(spread(here, samples)) for here, there in ((mesh, other), (other, mesh))
    ]
    return GeometricError(
        max(float(np.sqrt((way**2).mean())) for way in ways), max(float(way.max()) for way in ways)
    )


def spread(mesh: TriangleMesh, number: int) -> Floats:
    """(number, 3) random points, as many per area everywhere; the same ones at each call."""
    random = np.random.default_rng(0)
    area = np.linalg.norm(mesh.face_normals, axis=1).cumsum()
    # One in each of as many equal parts of the area: closer to even than all at random.
    sampled = (np.arange(number) + random.uniform(size=number)) / number * area[-1]
    face = np.minimum(np.searchsorted(area, sampled), len(area) - 1)
    root, second = np.sqrt(random.uniform(size=number)), random.uniform(size=number)
    weights = np.column_stack((1.0 - root, root * (1.0 - second), root * second))
    return np.asarray((weights[..., np.newaxis] * mesh.corners[face]).sum(axis=1))

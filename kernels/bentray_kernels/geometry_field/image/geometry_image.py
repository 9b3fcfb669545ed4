"""Geometry images: a surface as a square image of positions, with normals and colours."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Flags, Floats
from ...meshes.mesh import Chart, TriangleMesh
from .raster import OUTSIDE, Raster, rasterised
from .stitching import stitched


@dataclass(frozen=True)
class GeometryImage:
    """Gu, Gortler and Hoppe, "Geometry images" (2002); dissertation, 5.2.1.

    Attributes:
        chart: what was sampled.
        raster: the point of the surface at each of the n² pixels.
    """

    chart: Chart
    raster: Raster

    @property
    def size(self) -> int:
        """Pixels along each side."""
        return len(self.raster.kind)

    @property
    def valid(self) -> Flags:
        """(n, n) whether a pixel represents a point of the surface."""
        valid: Flags = self.raster.kind != OUTSIDE
        return valid

    @cached_property
    def positions(self) -> Floats:
        """(n, n, 3) in the unit cube, axes (u, v); 0 where not valid."""
        return self.raster.sampled(self.chart.mesh.corners)

    @cached_property
    def normals(self) -> Floats:
        """(n, n, 3) unit vectors, the normals of the vertices interpolated; 0 where not valid."""
        normals = self.raster.sampled(self.chart.mesh.vertex_normals[self.chart.mesh.faces])
        length = np.linalg.norm(normals, axis=-1, keepdims=True)
        return np.asarray(normals / np.where(length > 0.0, length, 1.0))

    def sampled(self, values: Floats) -> Floats:
        """Values of the mesh's vertices, (vertices, k), as colours are: (n, n, k); 0 where not valid."""
        return self.raster.sampled(values[self.chart.mesh.faces])

    def mesh(self) -> TriangleMesh:
        """The surface again, stitched along its seam; see ``image.stitching.stitched``."""
        return stitched(self.chart, self.raster)


def geometry_image(chart: Chart, size: int) -> GeometryImage:
    """Sample a chart at size² pixels.

    Raises:
        InvalidInput: for a size below 8.
    """
    return GeometryImage(chart, rasterised(chart, size))

"""All lookups of one mesh, and the evaluation of published ones in the geometry image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bentray_kernels.geometry_field.image.geometry_image import GeometryImage
from bentray_kernels.geometry_field.tables.accurate_lookup import STEPS, find
from bentray_kernels.geometry_field.tables.agreement import agreement
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.geometry_field.tables.reference_field import uv_table
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import Surface, surface_of

from ._field_rays import as_columns, build_outer_field
from ._plane_lookup import PlaneTable, find_by_plane, plane_table
from ._reference_lookup import find_linear, linear_uv, nearest_uv

# Samples along an edge of the cube, as the dissertation has them, and pixels of the geometry image.
SAMPLES, PIXELS = 24, 512


@dataclass(frozen=True)
class Lookups:
    """A surface, its field, the published table of (u, v), where entries agree, and their planes."""

    surface: Surface
    field: OuterField
    table: np.ndarray
    known: np.ndarray
    planes: PlaneTable

    @classmethod
    def from_chart(cls, chart: Chart, n: int) -> Lookups:
        """Build the field of a chart's mesh, and what the lookups need."""
        surface = surface_of(chart)
        field = build_outer_field(surface, n)
        table = uv_table(surface, field)
        return cls(surface, field, table, agreement(field), plane_table(surface, field))

    def runs(self, rays: tuple[np.ndarray, np.ndarray]) -> tuple[dict[str, Callable], dict[str, np.ndarray]]:
        """Name to run, and name to what it found last: distances or (u, v); faces and weights of them all."""
        o, d = as_columns(rays)
        count, n = o.shape[1], self.field.samples
        results = {name: np.empty(count, np.float32) for name in ("plane", "walk", "linear place")}
        results |= {name: np.empty((count, 2), np.float32) for name in ("nearest uv", "linear uv")}
        results |= {"faces": np.empty(count, np.int32), "weights": np.empty((2, count), np.float32)}
        here, faces, weights = (self.surface, self.field), results["faces"], results["weights"]
        return {
            "plane": lambda: find_by_plane(self.planes, o, d, results["plane"]),
            "walk": lambda: find(*here, o, d, STEPS, faces, results["walk"], weights),
            "linear place": lambda: find_linear(*here, self.known, o, d, faces, results["linear place"]),
            "nearest uv": lambda: nearest_uv(n, self.table, o, d, results["nearest uv"]),
            "linear uv": lambda: linear_uv(n, self.table, o, d, results["linear uv"]),
        }, results

    def normals(self, faces: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(rays, 3) smooth normals at what ``find`` found, not unit vectors; NaN for nothing."""
        share = np.column_stack([*weights, 1.0 - weights.sum(axis=0)])
        normals = (share[:, :, None] * self.surface.normals[faces]).sum(axis=1)
        normals[faces < 0] = np.nan
        return normals


def between_pixels(image: GeometryImage, values: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """``values`` of an image's pixels at (u, v), (rays, 3); NaN for no (u, v) and beside the chart."""
    hit = np.isfinite(uv[:, 0])
    at = np.where(hit[:, None], uv, 0.0) * (image.size - 1)
    low = np.clip(at.astype(int), 0, image.size - 2)
    way = at - low
    mean, valid = np.zeros((len(uv), 3)), hit
    for i, j in np.ndindex(2, 2):
        pixel = low[:, 0] + i, low[:, 1] + j
        mean += (np.abs(1 - i - way[:, 0]) * np.abs(1 - j - way[:, 1]))[:, None] * values[pixel]
        valid = valid & image.valid[pixel]
    mean[~valid] = np.nan
    return mean

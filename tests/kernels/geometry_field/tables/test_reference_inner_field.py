"""The published inner table of (u, v): its own rays, averages over exits, and rejected arguments."""

import numpy as np
import pytest

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables import reference_inner_field
from bentray_kernels.geometry_field.tables.cube import samples
from bentray_kernels.geometry_field.tables.inner_field import spread_points
from bentray_kernels.geometry_field.tables.reference_inner_field import inner_uv_table, linear_exit_uv
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of

from ..shapes import inner_of, octahedron, turned

N, DIVISIONS = 5, 4


@kernel
def averaged_at(row, n, face, x, y):
    return linear_exit_uv(row, n, face, x, y)


def flat_table():
    """A ball whose u and v are x and y, its inner field, points and table."""
    mesh = turned(octahedron(3))
    surface = surface_of(Chart(mesh, mesh.corners[..., :2]))
    field, points = inner_of(surface, N, DIVISIONS), spread_points(surface, DIVISIONS)[0]
    return surface, field, points, inner_uv_table(surface, field, points)


def test_the_table_holds_where_its_own_rays_end():
    surface, field, points, table = flat_table()
    np.testing.assert_array_equal(np.isnan(table[..., 0]), field.faces < 0)
    row, exit_ = np.nonzero(field.faces >= 0)
    corners = surface.triangles[:, :9].reshape(-1, 3, 3).astype(float)
    starts = corners.mean(axis=1)[points[row]]
    along = samples(N)[exit_] - starts
    first, second, third = np.moveaxis(corners[field.faces[row, exit_]], 1, 0)
    normals = np.cross(second - first, third - first)
    far = ((first - starts) * normals).sum(axis=1) / (along * normals).sum(axis=1)
    ends = starts + far[:, None] * along
    # Nearly all rays run through the body; few graze a face.
    flat = np.abs((along * normals).sum(axis=1)) > 0.05 * np.linalg.norm(normals, axis=1)
    assert flat.mean() > 0.8
    np.testing.assert_allclose(table[row, exit_][flat], ends[flat, :2], atol=1e-4)


def test_exits_are_averaged_and_those_without_a_hit_left_out():
    q, p = np.indices((N, N), dtype=np.float32)
    row = np.full((N, 6, N, 2), np.nan, np.float32)
    row[:, 2, :, 0], row[:, 2, :, 1] = 0.1 * p + 0.02 * q, 0.05 * q
    position = (2.25 + 0.5) / N, (1.5 + 0.5) / N
    result = averaged_at(row.ravel(), N, 2, *map(np.float32, position))
    np.testing.assert_allclose(result, (0.1 * 2.25 + 0.02 * 1.5, 0.05 * 1.5), atol=1e-6)
    row[:, 2, 3] = np.nan
    result = averaged_at(row.ravel(), N, 2, *map(np.float32, position))
    np.testing.assert_allclose(result, (0.1 * 2.0 + 0.02 * 1.5, 0.05 * 1.5), atol=1e-6)


def test_points_of_another_field_and_large_tables_are_rejected(monkeypatch):
    surface, field, points, _ = flat_table()
    with pytest.raises(InvalidInput) as caught:
        inner_uv_table(surface, field, points[:-1])
    assert caught.value.field == "points"
    monkeypatch.setattr(reference_inner_field, "MAX_INNER_ENTRIES", field.faces.size - 1)
    with pytest.raises(InvalidInput) as caught:
        inner_uv_table(surface, field, points)
    assert caught.value.field == "divisions"

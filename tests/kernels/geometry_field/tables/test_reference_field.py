"""The published tables of (u, v): averages over entries that hit, interpolation, and bilinear images."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables import reference_inner_field
from bentray_kernels.geometry_field.tables.cube import samples
from bentray_kernels.geometry_field.tables.inner_field import spread_points
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.geometry_field.tables.quadrilinear import corner_of, lerp4, nearest_of
from bentray_kernels.geometry_field.tables.reference_field import (
    MAX_REFERENCE_SAMPLES,
    image_at,
    linear_uv_at,
    reference_field,
    uv_table,
)
from bentray_kernels.geometry_field.tables.reference_inner_field import inner_uv_table, linear_exit_uv
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import surface_of

from ..shapes import ball, field_of, inner_of, octahedron, turned

N = 6


@kernel
def averaged_at(entries, n, corner):
    return linear_uv_at(entries, n, corner, nearest_of(n, corner))


@kernel
def sampled_at(image, pixels, u, v, channel):
    return image_at(image, 0, pixels, u, v, channel)


def linear_table():
    """(u, v) linear in the four coordinates of an entry, on face 0 of the cube by face 1."""
    table = np.full((N, 6, N, N, 6, N, 2), np.nan, np.float32)
    y, x, q, p = np.indices((N, N, N, N))
    table[:, 0, :, :, 1, :, 0] = 0.01 * x + 0.02 * y + 0.03 * p
    table[:, 0, :, :, 1, :, 1] = 0.05 * q + 0.01
    return table


def corner(x0, x1, x2, x3):
    low = [int(x) for x in (x0, x1, x2, x3)]
    part = [x - k for x, k in zip((x0, x1, x2, x3), low, strict=True)]
    entry, exit_ = 6 * N * low[1] + low[0], 6 * N * low[3] + low[2] + N
    return (entry * 6 * N * N + exit_, *part)


def test_linear_interpolation_is_exact_for_linear_values():
    u, v = averaged_at(linear_table().ravel(), N, corner(1.25, 2.5, 3.75, 0.4))
    np.testing.assert_allclose((u, v), (0.01 * 1.25 + 0.02 * 2.5 + 0.03 * 3.75, 0.05 * 0.4 + 0.01), atol=1e-6)


def test_entries_without_a_hit_are_left_out():
    table = linear_table()
    table[:, 0, 2] = np.nan
    u, _ = averaged_at(table.ravel(), N, corner(1.25, 2.5, 3.0, 0.0))
    # Only the samples x = 1 are left of 1 and 2.
    assert u == pytest.approx(0.01 + 0.02 * 2.5 + 0.03 * 3.0, abs=1e-6)
    assert np.isnan(averaged_at(table.ravel(), N, corner(1.75, 2.5, 3.0, 0.0))[0])


def test_images_are_bilinear_and_nan_beside_the_chart():
    i, j = np.indices((5, 5)) / 4.0
    image = np.stack([i, j, i + j, i * j, -i, -j], axis=2).astype(np.float32)
    for u, v in ((0.3, 0.6), (1.0, 1.0), (0.0, 0.99)):
        np.testing.assert_allclose(sampled_at(image.ravel(), 5, u, v, 0), (u, v, u + v), atol=1e-6)
    np.testing.assert_allclose(sampled_at(image.ravel(), 5, 0.5, 0.75, 3), (0.375, -0.5, -0.75), atol=1e-6)
    image[2, 3] = np.nan
    assert np.isnan(sampled_at(image.ravel(), 5, 0.55, 0.7, 0)).all()


def test_a_field_holds_table_and_image():
    surface = ball(2)
    field = field_of(surface, 4)
    positions = np.random.default_rng(0).random((9, 9, 3))
    valid = np.ones((9, 9), bool)
    valid[0, 0] = False
    made = reference_field(surface, field, positions, -positions, valid)
    np.testing.assert_array_equal(made.uv, uv_table(surface, field))
    np.testing.assert_array_equal(np.isnan(made.uv[..., 0]), field.faces < 0)
    np.testing.assert_array_equal(made.image[1:, :, :3], np.float32(positions[1:]))
    np.testing.assert_array_equal(made.image[1:, :, 3:], np.float32(-positions[1:]))
    assert np.isnan(made.image[0, 0]).all()


def test_too_many_samples_and_other_shapes_are_rejected():
    surface, valid, points = ball(0), np.ones((9, 9), bool), np.zeros((9, 9, 3))
    many = OuterField(MAX_REFERENCE_SAMPLES + 1, np.zeros((1, 1), np.int32), np.zeros((1, 1), np.float32))
    with pytest.raises(InvalidInput, match=r"^samples: found"):
        reference_field(surface, many, points, points, valid)
    with pytest.raises(InvalidInput, match=r"^positions: found"):
        reference_field(surface, field_of(surface, 4), points[:8], points, valid)


INNER_N, DIVISIONS = 5, 4


@kernel
def averaged_exit_at(row, n, face, x, y):
    return linear_exit_uv(row, n, face, x, y)


def flat_table():
    """A ball whose u and v are x and y, its inner field, points and table."""
    mesh = turned(octahedron(3))
    surface = surface_of(Chart(mesh, mesh.corners[..., :2]))
    field, points = inner_of(surface, INNER_N, DIVISIONS), spread_points(surface, DIVISIONS)[0]
    return surface, field, points, inner_uv_table(surface, field, points)


def test_the_table_holds_where_its_own_rays_end():
    surface, field, points, table = flat_table()
    np.testing.assert_array_equal(np.isnan(table[..., 0]), field.faces < 0)
    row, exit_ = np.nonzero(field.faces >= 0)
    corners = surface.triangles[:, :9].reshape(-1, 3, 3).astype(float)
    starts = corners.mean(axis=1)[points[row]]
    along = samples(INNER_N)[exit_] - starts
    first, second, third = np.moveaxis(corners[field.faces[row, exit_]], 1, 0)
    normals = np.cross(second - first, third - first)
    far = ((first - starts) * normals).sum(axis=1) / (along * normals).sum(axis=1)
    ends = starts + far[:, None] * along
    # Nearly all rays run through the body; few graze a face.
    flat = np.abs((along * normals).sum(axis=1)) > 0.05 * np.linalg.norm(normals, axis=1)
    assert flat.mean() > 0.8
    np.testing.assert_allclose(table[row, exit_][flat], ends[flat, :2], atol=1e-4)


def test_exits_are_averaged_and_those_without_a_hit_left_out():
    q, p = np.indices((INNER_N, INNER_N), dtype=np.float32)
    row = np.full((INNER_N, 6, INNER_N, 2), np.nan, np.float32)
    row[:, 2, :, 0], row[:, 2, :, 1] = 0.1 * p + 0.02 * q, 0.05 * q
    position = (2.25 + 0.5) / INNER_N, (1.5 + 0.5) / INNER_N
    result = averaged_exit_at(row.ravel(), INNER_N, 2, *map(np.float32, position))
    np.testing.assert_allclose(result, (0.1 * 2.25 + 0.02 * 1.5, 0.05 * 1.5), atol=1e-6)
    row[:, 2, 3] = np.nan
    result = averaged_exit_at(row.ravel(), INNER_N, 2, *map(np.float32, position))
    np.testing.assert_allclose(result, (0.1 * 2.0 + 0.02 * 1.5, 0.05 * 1.5), atol=1e-6)


def test_points_of_another_field_and_large_tables_are_rejected(monkeypatch):
    surface, field, points, _ = flat_table()
    with pytest.raises(InvalidInput, match=r"^points: found"):
        inner_uv_table(surface, field, points[:-1])
    monkeypatch.setattr(reference_inner_field, "MAX_INNER_ENTRIES", field.faces.size - 1)
    with pytest.raises(InvalidInput, match=r"^divisions: found"):
        inner_uv_table(surface, field, points)


PLACES = st.floats(0.0, 1.0, width=32)


def table(n, value):
    """Entries by entry and exit sample, flat (6n², 6n², 2) float32: zeros, and ``value(faces, xs, ys)``."""
    number = np.arange(6 * n * n)
    face, x, y = number % (6 * n) // n, (number % n + 0.5) / n, (number // (6 * n) + 0.5) / n
    entries = np.zeros((6 * n * n, 6 * n * n, 2), np.float32)
    entries[..., 1] = value(*(np.meshgrid(axis, axis, indexing="ij") for axis in (face, x, y)))
    return entries.ravel()


def product(faces, xs, ys):
    return (
        (1.0 + faces[0] + 0.1 * faces[1])
        * (1.0 + 2.0 * xs[0])
        * (2.0 - ys[0])
        * (0.5 + xs[1])
        * (1.0 + 3.0 * ys[1])
    )


@pytest.mark.parametrize("n", [2, 3, 5])
@given(faces=st.tuples(st.integers(0, 5), st.integers(0, 5)), ends=st.tuples(*[PLACES] * 4))
def test_products_of_linear_functions_are_exact_between_samples_and_constant_beyond(n, faces, ends):
    entries = table(n, product)
    s, t = faces
    corner = corner_of(n, s, np.float32(ends[0]), np.float32(ends[1]), t, *map(np.float32, ends[2:]))
    inside = np.clip(ends, 0.5 / n, 1.0 - 0.5 / n)
    expected = product((s, t), inside[::2], inside[1::2])
    assert lerp4(entries, n, corner, 2, 1) == pytest.approx(expected, rel=1e-4)
    assert lerp4(entries, n, corner, 2, 0) == 0.0
    nearest = np.clip(np.floor(np.array(ends) * n), 0, n - 1)
    whole = (np.abs(np.array(ends) * n - np.rint(np.array(ends) * n)) > 1e-4).all()
    if whole:
        centre = (nearest + 0.5) / n
        at = entries.reshape(-1, 2)[nearest_of(n, corner), 1]
        assert at == pytest.approx(product((s, t), centre[::2], centre[1::2]), rel=1e-5)

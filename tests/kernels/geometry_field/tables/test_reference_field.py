"""The published table of (u, v): averages over entries that hit, and bilinear geometry images."""

import numpy as np
import pytest

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.geometry_field.tables.quadrilinear import nearest_of
from bentray_kernels.geometry_field.tables.reference_field import (
    MAX_REFERENCE_SAMPLES,
    image_at,
    linear_uv_at,
    reference_field,
    uv_table,
)

from ..shapes import ball, field_of

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
    with pytest.raises(InvalidInput) as caught:
        reference_field(surface, many, points, points, valid)
    assert caught.value.field == "samples"
    with pytest.raises(InvalidInput) as caught:
        reference_field(surface, field_of(surface, 4), points[:8], points, valid)
    assert caught.value.field == "positions"

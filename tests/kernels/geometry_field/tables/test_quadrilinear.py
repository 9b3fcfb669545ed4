"""Interpolation between the 16 entries about a line: exact for products of linear functions of its ends."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.geometry_field.tables.quadrilinear import corner_of, lerp4, nearest_of

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
@settings(deadline=None)
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

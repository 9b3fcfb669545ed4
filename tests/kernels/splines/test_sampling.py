"""The innermost sampling functions: values on and off the grid, and rejected input."""

import numpy as np
import pytest
from numba.core.errors import TypingError

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.splines import FILTERS, Spline
from bentray_kernels.splines.sampler import sampled_value, sampled_value_and_gradient, sampler_of
from bentray_kernels.splines.sampling import (
    border_of,
    lies_within,
    stencil_of,
    value_and_gradient_at,
    value_at,
)


@kernel
def read(coefficients, stencil, x, y, z):
    value = value_at(coefficients, stencil, (x, y, z))
    same, slopes = value_and_gradient_at(coefficients, stencil, (x, y, z))
    return value, same, slopes[0], slopes[1], slopes[2]


@kernel
def read_by_address(sampler, x, y, z):
    same, slopes = sampled_value_and_gradient(sampler, (x, y, z))
    return sampled_value(sampler, (x, y, z)), same, slopes[0], slopes[1], slopes[2]


def volume(seed=0, shape=(5, 7, 6)):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, shape)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("position", [(1.3, 4.0, 2.81), (0.0, 6.0, 5.0), (-0.9, 6.6, 5.4)])
def test_equals_the_sum_over_the_taps(name, dtype, position):
    """Written out in numpy from the filter's own matrices; off the grid the outermost cell goes on."""
    spline = Spline.from_volume(volume(), name, dtype=dtype)
    used, point = spline.filter, np.array(position)
    last = np.array(spline.coefficients.shape) - used.taps
    cells = np.clip(np.floor(point + used.shift).astype(int), 0, last)
    part = spline.coefficients[tuple(slice(i, i + used.taps) for i in cells)].astype(float)
    powers = (point + used.shift - cells)[:, np.newaxis] ** np.arange(used.value.shape[1])
    w, d = powers @ used.value.T, powers @ used.slope.T
    sums = [
        np.einsum("ijk,i,j,k", part, *rows)
        for rows in ((w[0], w[1], w[2]), (d[0], w[1], w[2]), (w[0], d[1], w[2]), (w[0], w[1], d[2]))
    ]
    value, same, *slopes = read(spline.coefficients, spline.stencil, *point)
    allowed = 1e-12 if dtype == np.float64 else 1e-4
    assert value == pytest.approx(sums[0], abs=allowed)
    assert same == pytest.approx(sums[0], abs=allowed)
    assert slopes == pytest.approx(sums[1:], abs=10 * allowed)


@pytest.mark.parametrize("name", FILTERS)
def test_never_reads_beyond_the_coefficients(name):
    """Corners of a grid that lies between NaNs."""
    spline = Spline.from_volume(volume(shape=(3, 2, 3)), name)
    among = np.full(spline.coefficients.size + 40, np.nan)
    among[20:-20] = spline.coefficients.ravel()
    inside = among[20:-20].reshape(spline.coefficients.shape)
    for corner in np.ndindex(2, 2, 2):
        point = np.array(corner) * [2.0, 1.0, 2.0]
        assert np.isfinite(read(inside, spline.stencil, *point)).all()


@pytest.mark.parametrize("far", [1e300, -1e300, np.inf, -np.inf, np.nan])
def test_far_points_and_nan_stay_in_bounds(far):
    spline = Spline(volume())
    assert not np.isfinite(read(spline.coefficients, spline.stencil, 1.0, far, 2.0)[0])


def test_arrays_that_the_instructions_would_misread_are_rejected():
    spline = Spline(volume())
    for wrong in (
        np.asfortranarray(spline.coefficients),
        spline.coefficients[:, :, ::2],
        spline.coefficients.astype(np.int64),
        spline.coefficients[0],
    ):
        with pytest.raises(TypingError, match="accepted"):
            read(wrong, spline.stencil, 1.0, 2.0, 3.0)
    with pytest.raises(TypingError, match="accepted"):
        read(spline.coefficients, spline.stencil, 1, 2, 3)


def test_accepts_read_only_coefficients():
    spline = Spline(volume())
    fixed = spline.coefficients.copy()
    fixed.setflags(write=False)
    assert read(fixed, spline.stencil, 1.0, 2.0, 3.0) == read(
        spline.coefficients, spline.stencil, 1.0, 2.0, 3.0
    )


@pytest.mark.parametrize("name", FILTERS)
def test_the_border_is_just_wide_enough(name):
    """The first and the last point of the grid read the first and the last node of the border."""
    used = FILTERS[name]
    before, after = border_of(used)
    n, stencil = 4, stencil_of(used)
    for end, place in ((0, 0.01), (-1, n - 1.01)):
        line = np.zeros(n + before + after)
        line[end] = 1.0
        value, (slope,) = read_1d(line, stencil, place)
        assert (value, slope) != (0.0, 0.0)


@kernel
def read_1d(coefficients, stencil, x):
    return value_and_gradient_at(coefficients, stencil, (x,))


@kernel
def inside(x, y, z, last_x, last_y, last_z):
    return lies_within((x, y, z), (last_x, last_y, last_z)), lies_within((x, y), (last_x, last_y))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("position", "found"),
    [(0.0, True), (-0.0, True), (4.0, True), (-1e-300, False), (4.000001, False), (np.nan, False)],
)
def test_the_outer_nodes_belong_to_the_grid(axis, position, found):
    point = [1.0, 2.0, 3.0]
    point[axis] = position
    assert inside(*point, 4.0, 4.0, 4.0) == (found, found or axis == 2)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_sampler_reads_the_same_to_the_bit(name, dtype):
    spline = Spline.from_volume(volume(), name, dtype=dtype)
    sampler = sampler_of(spline)
    for place in ((1.3, 4.0, 2.81), (0.0, 6.0, 5.0), (-0.9, 6.6, 5.4), (1.0, 1e300, 2.0), (1.0, np.nan, 2.0)):
        expected = read(spline.coefficients, spline.stencil, *place)
        np.testing.assert_array_equal(read_by_address(sampler, *place), expected)

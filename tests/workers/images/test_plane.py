"""Slices of arrays: across the right axis, at the right place, refused by name."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.images.plane import plane_of

VALUES = np.arange(60.0).reshape(3, 4, 5)
GRID = ((1e-3, 2e-3, 3e-3), (0.0, 0.1, 0.2))


@given(axis=st.sampled_from("xyz"), data=st.data())
def test_every_slice_is_the_values_across_its_axis(axis, data):
    number = "xyz".index(axis)
    index = data.draw(st.integers(0, VALUES.shape[number] - 1))
    plane = plane_of(VALUES, *GRID, axis, index)
    np.testing.assert_array_equal(plane.image, np.moveaxis(VALUES, number, 0)[index])
    kept = [k for k in range(3) if k != number]
    assert plane.names == "".join("xyz"[k] for k in kept)
    assert plane.spacing_m == tuple(GRID[0][k] for k in kept)
    assert plane.origin_m == tuple(GRID[1][k] for k in kept)
    assert plane.place_m == pytest.approx(GRID[1][number] + index * GRID[0][number])
    assert (plane.index, plane.count) == (index, VALUES.shape[number])


def test_without_an_index_the_middle_one_is_taken():
    assert plane_of(VALUES, *GRID, "y").caption() == "slice index 2 (0 to 3), y = 104 mm"


def test_a_plain_image_is_its_own_slice():
    plane = plane_of(VALUES[0], (1e-3, 1e-3), (0.0, 0.0))
    np.testing.assert_array_equal(plane.image, VALUES[0])
    assert (plane.names, plane.caption()) == ("xy", "")


def test_uneven_heights_have_no_place():
    plane = plane_of(VALUES, (1e-3, 1e-3, math.nan), GRID[1], "z", 1)
    assert plane.caption() == "slice index 1 (0 to 4)"


@pytest.mark.parametrize(
    ("values", "steps", "axis", "index", "field"),
    [
        (VALUES, 1e-3, "x", 3, "index"),
        (VALUES, 1e-3, "z", -1, "index"),
        (VALUES, 1e-3, "w", None, "axis"),
        (VALUES, 1e-3, "xy", None, "axis"),
        (VALUES, 1e-3, "", None, "axis"),
        (VALUES, math.nan, "y", None, "axis"),
        (VALUES[0], 1e-3, "x", None, "axis"),
        (VALUES[0], 1e-3, "z", 1, "index"),
    ],
)
def test_refusals(values, steps, axis, index, field):
    with pytest.raises(InvalidInput) as caught:
        plane_of(values, (1e-3, 1e-3, steps)[: values.ndim], GRID[1], axis, index)
    assert caught.value.field == field

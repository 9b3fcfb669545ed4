"""Layouts in the square: the same shape, as large as it can be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.geometry_field.layout.framing import in_unit_square


@given(st.floats(0.0, 7.0), st.floats(1e-3, 1e3), st.floats(0.1, 1.0))
def test_a_rectangle_fills_what_it_can(angle, scale, side):
    c, s = np.cos(angle), np.sin(angle)
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, side), (0.0, side)]) @ np.array([(c, s), (-s, c)])
    placed = in_unit_square(scale * corners + 7.0)
    assert placed.min() >= 0.0
    assert placed.max() <= 1.0
    # Upright, or along the diagonal where it is thin: never smaller than upright, less the step of the turns.
    lengths = np.linalg.norm(np.roll(placed, -1, axis=0) - placed, axis=1)
    assert lengths[0] >= 0.98
    assert lengths[1] / lengths[0] == pytest.approx(side, rel=1e-9)


def test_orientation_stays():
    corners = np.random.default_rng(0).uniform(size=(30, 2))
    placed = in_unit_square(corners)
    for one, other in ((corners, placed),):
        before = np.cross(np.c_[one[1:-1] - one[0], np.zeros(28)], np.c_[one[2:] - one[0], np.zeros(28)])[
            :, 2
        ]
        after = np.cross(
            np.c_[other[1:-1] - other[0], np.zeros(28)], np.c_[other[2:] - other[0], np.zeros(28)]
        )
        np.testing.assert_allclose(after[:, 2] / before, (after[:, 2] / before)[0])
        assert (after[:, 2] / before)[0] > 0.0

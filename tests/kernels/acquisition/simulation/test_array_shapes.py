"""Elements of simulated arrays: where they are, and that they look at the object."""

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation import array_shapes


@pytest.mark.parametrize(("degrees", "last"), [(360.0, 270.0), (400.0, 270.0), (180.0, 180.0), (90.0, 90.0)])
def test_only_a_whole_circle_ends_before_its_first_element(degrees, last):
    shape = array_shapes.arc(4, 0.1, degrees)
    angle = np.radians(np.linspace(0.0, last, 4))
    np.testing.assert_allclose(
        shape.position_m, 0.1 * np.column_stack((np.cos(angle), np.sin(angle))), atol=1e-15
    )
    np.testing.assert_allclose(shape.normal, -shape.position_m / 0.1, atol=1e-15)


def test_facing_lines_look_at_each_other():
    shape = array_shapes.facing_lines(3, 0.06, 0.1)
    np.testing.assert_allclose(shape.position_m[:, 0], [-0.05] * 3 + [0.05] * 3)
    np.testing.assert_allclose(shape.position_m[:, 1], [-0.03, 0.0, 0.03] * 2)
    np.testing.assert_array_equal(shape.normal, [[1.0, 0.0]] * 3 + [[-1.0, 0.0]] * 3)


def test_the_elements_of_a_bowl_look_at_its_middle():
    shape = array_shapes.bowl(9, 0.1)
    np.testing.assert_allclose(shape.position_m, -0.1 * shape.normal, atol=1e-15)
    assert (shape.position_m[:, 2] < 0.0).all()

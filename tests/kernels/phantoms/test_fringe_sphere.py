"""Glass balls: their plateaus, their iso-surfaces and their gradients."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import ONE_HOLE, TWO_HOLES, FringeSphere

FIELDS = [FringeSphere(), ONE_HOLE, TWO_HOLES]


@pytest.mark.parametrize("field", FIELDS)
@given(point=st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_gradient_is_the_derivative(field, point):
    at, step = np.array(point), 1e-6
    if np.linalg.norm(at) < 1e-3:
        return
    expected = [(field.value(at + step * e) - field.value(at - step * e)) / (2 * step) for e in np.eye(3)]
    # The second derivative jumps where a fringe begins.
    assert field.gradient(at) == pytest.approx(expected, abs=1e-3)


@given(radius=st.floats(0.1, 0.6), fringe=st.floats(0.02, 0.3), iso=st.floats(0.01, 0.99))
def test_the_iso_radius_has_the_iso_value(radius, fringe, iso):
    field = FringeSphere(radius, fringe)
    at = np.array([0.0, 0.6, 0.8]) * field.iso_radius(iso)
    assert field.value(at) == pytest.approx(iso)


def test_plateaus_are_1_in_glass_and_0_in_air():
    assert FringeSphere(0.5, 0.1).value(np.array([0.3, 0.2, -0.3])) == 1.0
    assert ONE_HOLE.value(np.array([0.1, 0.1, 0.0])) == 0.0
    assert TWO_HOLES.value(np.array([[0.28, 0.05, 0.0], [-0.28, 0.0, 0.05]])).tolist() == [0.0, 0.0]
    assert TWO_HOLES.value(np.array([0.0, 0.0, 0.3])) > 0.98


def test_a_gradient_on_a_plateau_is_0():
    assert FringeSphere(0.5, 0.1).gradient(np.zeros(3)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ({"radius": 0.0}, "radius"),
        ({"fringe": float("nan")}, "fringe"),
        ({"holes": (((0.0, 0.0, 0.0), -1.0),)}, "holes"),
    ],
)
def test_impossible_balls_are_rejected(words, named):
    with pytest.raises(InvalidInput, match=named):
        FringeSphere(**words)


def test_an_iso_value_off_the_range_is_rejected():
    with pytest.raises(InvalidInput, match="iso"):
        FringeSphere().iso_radius(1.0)

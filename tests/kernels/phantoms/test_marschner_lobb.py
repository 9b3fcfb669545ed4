"""The Marschner–Lobb signal: its range, its symmetry and its gradient."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.phantoms import MarschnerLobb

INSIDE = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


def test_values_lie_between_0_and_1_and_reach_both():
    values = MarschnerLobb().value(np.random.default_rng(0).uniform(-1.0, 1.0, (200000, 3)))
    assert 0.0 <= values.min() < 0.01
    assert 0.99 < values.max() <= 1.0


@given(point=INSIDE, angle=st.floats(0.0, 6.3))
def test_rings_about_the_z_axis(point, angle):
    x, y, z = point
    turned = (x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z)
    field = MarschnerLobb()
    assert field.value(np.array(turned)) == pytest.approx(float(field.value(np.array(point))), abs=1e-12)


@given(point=INSIDE)
def test_gradient_is_the_derivative(point):
    field, at, step = MarschnerLobb(frequency=4.0, modulation=0.4), np.array(point), 1e-5
    expected = [(field.value(at + step * e) - field.value(at - step * e)) / (2 * step) for e in np.eye(3)]
    assert field.gradient(at) == pytest.approx(expected, abs=1e-5)


def test_on_the_axis_only_z_changes():
    gradient = MarschnerLobb().gradient(np.zeros(3))
    assert gradient == pytest.approx([0.0, 0.0, -0.5 * np.pi / 2.5])

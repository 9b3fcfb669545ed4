"""Exact fields: Marschner and Lobb's signal, glass balls, and volumes sampled from them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import (
    ONE_HOLE,
    TWO_HOLES,
    FringeSphere,
    MarschnerLobb,
    eight_bit,
    in_nodes,
    sampled,
)

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


# Their largest error: the second derivative of a ball jumps where a fringe begins.
@pytest.mark.parametrize(
    ("field", "most"),
    [
        (MarschnerLobb(frequency=4.0, modulation=0.4), 1e-5),
        *((ball, 1e-3) for ball in (FringeSphere(), ONE_HOLE, TWO_HOLES)),
    ],
)
@given(point=INSIDE)
def test_gradient_is_the_derivative(field, most, point):
    at, step = np.array(point), 1e-6
    if np.linalg.norm(at) < 1e-3:
        return
    expected = [(field.value(at + step * e) - field.value(at - step * e)) / (2 * step) for e in np.eye(3)]
    assert field.gradient(at) == pytest.approx(expected, abs=most)


def test_on_the_axis_only_z_changes():
    gradient = MarschnerLobb().gradient(np.zeros(3))
    assert gradient == pytest.approx([0.0, 0.0, -0.5 * np.pi / 2.5])


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


def test_nodes_hold_the_field_at_their_places():
    field, n = MarschnerLobb(), 7
    volume = sampled(field, n)
    assert volume.shape == (n, n, n)
    rng = np.random.default_rng(1)
    for node in rng.integers(0, n, (20, 3)):
        position = -1.0 + 2.0 * node / (n - 1)
        assert volume[tuple(node)] == pytest.approx(float(field.value(position)), abs=1e-14)
        assert in_nodes(position, n) == pytest.approx(node)


def test_eight_bits_are_rounded_and_clipped():
    levels = eight_bit(np.array([-1.0, 0.0, 0.5 / 255 - 1e-6, 0.5 / 255 + 1e-6, 1.0, 3.0]), 0.0, 1.0)
    assert levels.dtype == np.uint8
    assert levels.tolist() == [0, 0, 0, 1, 255, 255]


def test_rejects_fields_that_cannot_be_sampled():
    with pytest.raises(InvalidInput, match="nodes"):
        sampled(MarschnerLobb(), 1)
    with pytest.raises(InvalidInput, match="high"):
        eight_bit(np.ones(3), 1.0, 1.0)

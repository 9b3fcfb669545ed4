"""Local updates: exact for the travel times that their differences represent exactly."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.eikonal.updates import first_order_2d, first_order_3d, plain_update

SLOPES = st.floats(0.5, 3.0)


def around(ndim, time):
    """Times of the nodes of a 5-node cube about its middle, flat, and the strides."""
    axes = np.meshgrid(*[np.arange(-2.0, 3.0)] * ndim, indexing="ij")
    strides = tuple(5 ** (ndim - 1 - axis) for axis in range(ndim))
    return time(*axes).ravel(), (*strides, 0)[:3]


@pytest.mark.parametrize("ndim", [2, 3])
@pytest.mark.parametrize("second_order", [False, True])
@given(slopes=st.tuples(SLOPES, SLOPES, SLOPES), bends=st.tuples(*[st.floats(0.0, 0.1)] * 3))
@settings(deadline=None, max_examples=10)
def test_parabolas_of_any_direction_are_exact_in_second_order_and_planes_in_first(
    ndim, second_order, slopes, bends
):
    for signs in itertools.product((-1.0, 1.0), repeat=ndim):

        def time(*axes, signs=signs):
            terms = zip(axes, signs, slopes, bends, strict=False)
            return 50.0 + sum(s * a * x + second_order * b * x * x for x, s, a, b in terms)

        times, strides = around(ndim, time)
        middle = times.size // 2
        settled = np.where(times < times[middle], times, np.inf)
        # The slowness is the length of the gradient at the node.
        rhs = float(np.linalg.norm(slopes[:ndim]))
        result = plain_update(middle, strides, rhs, settled, second_order)
        assert result == pytest.approx(50.0, abs=1e-9)


@pytest.mark.parametrize("second_order", [False, True])
def test_an_axis_without_a_neighbour_or_with_a_later_one_has_no_share(second_order):
    settled = np.full(25, np.inf)
    settled[11] = 3.0
    assert plain_update(12, (5, 1, 0), 0.5, settled, second_order) == 3.5
    settled[17] = 3.6
    assert plain_update(12, (5, 1, 0), 0.5, settled, second_order) == 3.5
    settled[7] = 3.0
    diagonal = 3.0 + 0.5 / np.sqrt(2.0)
    assert plain_update(12, (5, 1, 0), 0.5, settled, second_order) == pytest.approx(diagonal)


@given(slopes=st.tuples(SLOPES, SLOPES, SLOPES))
def test_a_plane_wave_is_exact_along_one_to_three_axes(slopes):
    a, b, c = slopes
    assert first_order_2d(9.0 - a, 9.0 - b, np.hypot(a, b)) == pytest.approx(9.0)
    assert first_order_3d(9.0 - a, 9.0 - b, 9.0 - c, np.linalg.norm(slopes)) == pytest.approx(9.0)
    for order in itertools.permutations((9.0 - a, 9.0 - b, 20.0)):
        assert first_order_3d(*order, np.hypot(a, b)) == pytest.approx(9.0)
    for order in itertools.permutations((9.0 - a, 15.0, 20.0)):
        assert first_order_3d(*order, a) == pytest.approx(9.0)
    assert first_order_2d(9.0 - a, 9.5, a) == first_order_2d(9.5, 9.0 - a, a) == pytest.approx(9.0)

"""The filters' polynomials: their sums, their derivatives and how smoothly their pieces meet."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.splines.filters import FILTERS, bspline, filter_of


@pytest.mark.parametrize("name", FILTERS)
def test_weights_sum_to_1_and_slopes_to_0(name):
    read = filter_of(name)
    assert np.allclose(read.value.sum(axis=0), np.eye(read.value.shape[1])[0], atol=1e-15)
    assert np.allclose(read.slope.sum(axis=0), 0.0, atol=1e-15)


@pytest.mark.parametrize("name", [name for name in FILTERS if name != "central"])
def test_slopes_are_the_derivatives_of_the_weights(name):
    read = filter_of(name)
    derived = read.value[:, 1:] * np.arange(1, read.value.shape[1])
    assert np.allclose(read.slope[:, : derived.shape[1]], derived, atol=1e-15)
    assert not read.slope[:, derived.shape[1] :].any()


@pytest.mark.parametrize("order", range(1, 8))
def test_pieces_of_a_bspline_meet_with_all_derivatives_but_the_last(order):
    """Tap k at the end of one cell is tap k − 1 at the start of the next."""
    weights = bspline(order).value
    for _ in range(order):
        at_end, at_start = weights.sum(axis=1), weights[:, 0]
        assert np.allclose(at_end[1:], at_start[:-1], atol=1e-13)
        assert at_end[0] == pytest.approx(0.0, abs=1e-13)
        weights = weights[:, 1:] * np.arange(1, weights.shape[1])


@given(t=st.floats(0.0, 1.0))
def test_the_cubic_is_that_of_the_dissertation(t):
    """Equation 9, without its misprints: ½|x|³ − x² + ⅔ to 1, (2 − |x|)³ / 6 to 2."""
    read = bspline(3)
    for tap, weight in enumerate(read.value @ t ** np.arange(4)):
        x = abs(t - (tap - read.before))
        assert weight == pytest.approx(x**3 / 2 - x**2 + 2 / 3 if x < 1 else (2 - x) ** 3 / 6, abs=1e-14)


@pytest.mark.parametrize("name", FILTERS)
def test_taps_lie_about_the_point(name):
    """The weighted mean of the nodes' places is the place, but for the half node of a cell about a node."""
    read = filter_of(name)
    for t in (0.0, 0.3, 1.0):
        points = np.arange(read.taps) - read.before + read.shift
        mean = (read.value @ t ** np.arange(read.value.shape[1])) @ points
        assert mean == pytest.approx(t, abs=1e-14)


def test_an_unknown_filter_is_rejected_by_its_name():
    with pytest.raises(InvalidInput, match="lanczos") as caught:
        filter_of("lanczos")
    assert caught.value.field == "filter"
    assert "bspline6" in caught.value.accepted


def test_orders_and_names_agree():
    for order in range(2, 7):
        assert FILTERS[f"bspline{order}"].order == order
        assert FILTERS[f"bspline{order}"].taps == order + 1
        assert math.isclose(FILTERS[f"bspline{order}"].shift, 0.5 * (1 - order % 2))

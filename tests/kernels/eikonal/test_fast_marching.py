"""Fast marching, tidy or not: local updates, symmetric times, and no later than the stated bound."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.eikonal.fast_marching_untidy import BUCKETS, _bucket_width
from bentray_kernels.eikonal.problem import PointSource
from bentray_kernels.eikonal.updates import first_order_2d, first_order_3d, plain_update
from bentray_kernels.errors import InvalidInput

from ...effort import effort


def layered_speed(seed, shape, axes):
    """A speed of a few plane waves, within a factor of two, that does not change along the other axes."""
    rng = np.random.default_rng(seed)
    grids = np.meshgrid(*[np.linspace(0.0, 1.0, n) for n in shape], indexing="ij")
    waves = (
        np.sin(
            2.0 * np.pi * sum(k * x for k, x in zip(rng.normal(size=len(shape)) * axes, grids, strict=True))
        )
        for _ in range(3)
    )
    return 1.5 + 0.16 * sum(waves)


@pytest.mark.parametrize(("method", "order"), [("fmm", 1), ("fmm", 2), ("fmm-untidy", 2)])
@pytest.mark.parametrize("shape", [(16, 13), (8, 9, 7)], ids=["2d", "3d"])
@given(
    seed=st.integers(0, 2**32 - 1),
    axes=st.tuples(*[st.booleans()] * 3),
    halves=st.tuples(*[st.integers(0, 12)] * 3),
)
@settings(max_examples=effort(20, 40), deadline=None)
def test_sources_in_the_middle_of_a_cell_give_mirrored_times_in_a_mirror(
    method, order, shape, seed, axes, halves
):
    """Where the medium does not change along an axis, all times tie in pairs across the source."""
    speed = layered_speed(seed, shape, axes[: len(shape)])
    extent = 0.1 * (np.array(shape) - 1)
    source = 0.05 * np.array(halves[: len(shape)])
    tof = eikonal.solve(speed, 0.1, source, method, order=order)
    for axis in range(len(shape)):
        mirrored = np.where(np.arange(len(shape)) == axis, extent - source, source)
        flipped = eikonal.solve(np.flip(speed, axis), 0.1, mirrored, method, order=order)
        assert np.allclose(np.flip(flipped, axis), tof, rtol=1e-9, atol=1e-12)
    assert np.allclose(
        eikonal.solve(speed.T, 0.1, source[::-1], method, order=order).T, tof, rtol=1e-9, atol=1e-12
    )


def untidy_error_bound(problem, width=0.01):
    """By which part a first-order untidy time may be later than that of ``fast_marching``."""
    least = problem.spacing * float(problem.slowness.min())
    return _bucket_width(problem, width) * np.sqrt(problem.slowness.ndim) / least


WIDTHS = st.sampled_from([1e-4, 0.01, 0.1, 0.5, 1.0])


def excess(speed, source, order, width):
    """By which part untidy times are later than tidy ones: least and most, and the bound."""
    tidy = eikonal.solve(speed, 0.1, source, "fmm", order=order)
    untidy = eikonal.solve(speed, 0.1, source, "fmm-untidy", order=order, width=width)
    late = (untidy - tidy) / np.where(tidy > 0.0, tidy, 1.0)
    return late.min(), late.max(), untidy_error_bound(PointSource.checked(speed, 0.1, source), width=width)


@given(
    seed=st.integers(0, 2**32 - 1), width=WIDTHS, flat=st.booleans(), contrast=st.sampled_from([1.1, 5, 100])
)
@settings(max_examples=effort(20, 60), deadline=None)
def test_first_order_stays_within_the_bound_on_rough_models(seed, width, flat, contrast):
    shape = (24, 19) if flat else (8, 9, 7)
    rng = np.random.default_rng(seed)
    speed = contrast ** rng.uniform(0.0, 1.0, shape)
    source = 0.1 * rng.uniform(0.0, 1.0, len(shape)) * (np.array(shape) - 1)
    least, most, bound = excess(speed, source, 1, width)
    assert least >= -1e-12
    assert most <= bound + 1e-12


@given(seed=st.integers(0, 2**32 - 1), width=st.sampled_from([0.01, 0.1, 0.5]), middle=st.booleans())
@settings(max_examples=effort(20, 30), deadline=None)
def test_second_order_stays_within_the_bound_on_smooth_models(seed, width, middle):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(40) / 39, np.arange(40) / 39, indexing="ij")
    waves = rng.normal(size=(3, 2))
    speed = 1.5 + 0.1 * sum(np.sin(2 * np.pi * (a * x + b * y)) for a, b in waves)
    source = 0.1 * rng.integers(0, 39, 2) + 0.05 if middle else rng.uniform(0.0, 3.9, 2)
    least, most, bound = excess(speed, source, 2, width)
    assert max(most, -least) <= bound


def test_wide_buckets_are_untidy():
    """The bound is worth stating only where times do differ."""
    speed = np.random.default_rng(1).uniform(0.5, 2.0, (40, 40))
    assert excess(speed, (2.0, 2.0), 1, 1.0)[1] > 1e-4


def test_the_bound_falls_with_the_width():
    problem = PointSource.checked(np.ones((5, 5)), 1.0, (2.0, 2.0))
    assert untidy_error_bound(problem, width=0.01) == pytest.approx(0.01 * np.sqrt(2.0))
    assert untidy_error_bound(problem, width=0.02) == pytest.approx(0.02 * np.sqrt(2.0))


def test_high_contrast_widens_the_buckets_and_the_error_bound():
    speed = np.ones((6, 6))
    speed[3] = 1e-9
    problem = PointSource.checked(speed, 1.0, (0.0, 0.0))
    assert untidy_error_bound(problem) == pytest.approx(1e9 / BUCKETS * np.sqrt(2.0))
    assert np.isfinite(eikonal.solve(speed, 1.0, (0.0, 0.0), "fmm-untidy")).all()


@pytest.mark.parametrize("width", [0.0, -1.0, 1.5, float("nan")])
def test_rejects_invalid_bucket_widths(width):
    with pytest.raises(InvalidInput, match="above 0 and at most 1"):
        eikonal.solve(np.ones((3, 3)), 1.0, (1.0, 1.0), "fmm-untidy", width=width)
    with pytest.raises(InvalidInput, match="1 or 2"):
        eikonal.solve(np.ones((3, 3)), 1.0, (1.0, 1.0), "fmm-untidy", order=3)


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

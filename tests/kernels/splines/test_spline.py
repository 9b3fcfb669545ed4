"""Every filter, by the Spline class, in both types of coefficients; and what the class refuses."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.ndimage import map_coordinates

from bentray_kernels.errors import InvalidInput
from bentray_kernels.splines import FILTERS, Spline

from ...effort import effort

# One inherited test runs in several classes, which hypothesis would take for a mistake.
PROPERTY = settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.differing_executors])
SHAPES = st.lists(st.integers(2, 9), min_size=1, max_size=3).map(tuple)
SEEDS = st.integers(0, 2**32 - 1)

# The highest powers that a filter repeats exactly, far from the rim.
REPEATS = {"central": 1, "trilinear": 1, "catmull-rom": 2} | {f"bspline{n}": n for n in range(2, 7)}


def rough_volume(seed, shape):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, shape)


def points_about(seed, shape, number=40):
    """Points on and off the grid, some of them nodes."""
    rng = np.random.default_rng(seed + 1)
    points = rng.uniform(-1.2, 2.2, (number, len(shape))) * (np.array(shape) - 1)
    points[::5] = np.round(points[::5])
    return points


class EveryFilter:
    """The suite.

    Attributes:
        filters: names of the filters; a kernel is compiled for each of them and each number of axes.
        tolerance: relative to values of about 1.
    """

    filters: ClassVar[Sequence[str]] = tuple(FILTERS)
    tolerance: ClassVar[float] = 1e-11

    def read(self, spline, points):
        """Values and gradients as the engine finds them."""
        raise NotImplementedError

    def made(self, volume, name, **how):
        return Spline.from_volume(volume, name, **how)

    @given(shape=SHAPES, seed=SEEDS, prefilter=st.booleans())
    @PROPERTY
    def test_a_constant_stays_a_constant_without_slope(self, name, shape, seed, prefilter):
        spline = self.made(np.full(shape, -2.5), name, prefilter=prefilter)
        values, gradients = self.read(spline, points_about(seed, shape))
        assert np.allclose(values, -2.5, rtol=self.tolerance, atol=0.0)
        assert np.abs(gradients).max() < 30 * self.tolerance

    @given(shape=SHAPES, seed=SEEDS)
    @PROPERTY
    def test_passes_through_the_nodes(self, name, shape, seed):
        volume = rough_volume(seed, shape)
        nodes = np.argwhere(np.ones(shape)).astype(float)
        values, _ = self.read(self.made(volume, name), nodes)
        assert np.abs(values - volume.ravel()).max() < 30 * self.tolerance

    def test_repeats_polynomials(self, name):
        """In the middle of a line, where the mirrors at its ends are not felt."""
        nodes, middle, scale = np.arange(120.0), 59.4, 30.0
        points = np.random.default_rng(3).uniform(53.0, 66.0, (50, 1))
        for power in range(REPEATS[name] + 1):
            spline = self.made(((nodes - middle) / scale) ** power, name)
            values, gradients = self.read(spline, points)
            position = (points[:, 0] - middle) / scale
            assert np.abs(values - position**power).max() < 100 * self.tolerance
            slopes = power * position ** max(power - 1, 0) / scale
            assert np.abs(gradients[:, 0] - slopes).max() < 100 * self.tolerance

    def test_a_bspline_without_prefilter_repeats_lines(self, order):
        spline = self.made(0.1 * np.arange(30.0), f"bspline{order}", prefilter=False)
        values, gradients = self.read(spline, np.array([[9.37], [15.0], [16.5]]))
        assert np.abs(values - [0.937, 1.5, 1.65]).max() < 10 * self.tolerance
        assert np.abs(gradients - 0.1).max() < 10 * self.tolerance

    @given(shape=SHAPES, seed=SEEDS, prefilter=st.booleans())
    @PROPERTY
    def test_gradient_is_the_derivative(self, derived, shape, seed, prefilter):
        """By differences of the exact values, with no knot between a place and its neighbours."""
        rng, step = np.random.default_rng(seed), 1e-5
        spline = self.made(rough_volume(seed, shape), derived, prefilter=prefilter)
        points = rng.integers(0, np.array(shape) - 1, (20, len(shape))) + rng.uniform(0.02, 0.48, len(shape))
        points += 0.5 * rng.integers(0, 2, points.shape)
        _, gradients = self.read(spline, points)
        exact = Spline.from_volume(rough_volume(seed, shape), derived, prefilter=prefilter)
        for axis, unit in enumerate(np.eye(len(shape))):
            rise = exact.value(points + step * unit) - exact.value(points - step * unit)
            assert np.abs(gradients[:, axis] - rise / (2 * step)).max() < 1e-6 + 100 * self.tolerance

    @given(shape=SHAPES, seed=SEEDS)
    @PROPERTY
    def test_central_slopes_are_half_the_step_between_the_neighbours(self, shape, seed):
        volume = rough_volume(seed, shape)
        nodes = np.argwhere(np.ones(shape))
        _, gradients = self.read(self.made(volume, "central"), nodes.astype(float))
        bordered = np.pad(volume, 1, mode="reflect")
        for axis, unit in enumerate(np.eye(len(shape), dtype=int)):
            after, before = bordered[tuple((nodes + 1 + unit).T)], bordered[tuple((nodes + 1 - unit).T)]
            assert np.abs(gradients[:, axis] - 0.5 * (after - before)).max() < 10 * self.tolerance

    @given(shape=SHAPES, seed=SEEDS)
    @PROPERTY
    def test_goes_on_as_in_a_mirror(self, name, shape, seed):
        spline = self.made(rough_volume(seed, shape), name)
        points = np.random.default_rng(seed).uniform(0.02, 0.98, (20, len(shape))) * (np.array(shape) - 1)
        values, gradients = self.read(spline, points)
        for axis, n in enumerate(shape):
            for image in (-points[:, axis], 2 * (n - 1) - points[:, axis]):
                beyond, sign = points.copy(), np.ones(len(shape))
                beyond[:, axis], sign[axis] = image, -1.0
                their_values, their_gradients = self.read(spline, beyond)
                assert np.abs(their_values - values).max() < 100 * self.tolerance
                assert np.abs(sign * their_gradients - gradients).max() < 1000 * self.tolerance

    @given(shape=SHAPES, seed=SEEDS)
    @PROPERTY
    def test_equals_scipys_splines(self, scipy_order, shape, seed):
        volume, points = rough_volume(seed, shape), points_about(seed, shape)
        values, _ = self.read(
            self.made(volume, f"bspline{scipy_order}" if scipy_order > 1 else "trilinear"), points
        )
        expected = map_coordinates(volume, points.T, order=scipy_order, mode="mirror")
        assert np.abs(values - expected).max() < max(1e-12, 10 * self.tolerance)

    @given(length=st.integers(2, 30), seed=SEEDS, prefilter=st.booleans())
    @PROPERTY
    def test_is_the_sum_of_scipys_basis_functions(self, order, length, seed, prefilter):
        spline = self.made(rough_volume(seed, length), f"bspline{order}", prefilter=prefilter)
        numbers = spline.coefficients.astype(float)
        knots = np.arange(len(numbers) + order + 1) - spline.pad - 0.5 * (order + 1)
        theirs = BSpline(knots, numbers, order)
        points = np.random.default_rng(seed).uniform(0.0, length - 1.0, (40, 1))
        values, gradients = self.read(spline, points)
        assert np.abs(values - theirs(points[:, 0])).max() < 10 * self.tolerance
        assert np.abs(gradients[:, 0] - theirs.derivative()(points[:, 0])).max() < 100 * self.tolerance

    @pytest.mark.parametrize("wrong", [np.nan, np.inf])
    def test_a_place_that_is_no_number_has_no_value(self, name, wrong):
        spline = self.made(rough_volume(0, (5, 6, 7)), name)
        values, gradients = self.read(spline, np.array([[1.0, 2.0, 3.0], [1.0, wrong, 3.0]]))
        assert np.isfinite(values[0])
        assert np.isnan(values[1])
        assert np.isnan(gradients[1]).any()

    def test_no_points_give_no_values(self):
        values, gradients = self.read(self.made(rough_volume(0, (5, 6)), "bspline3"), np.empty((0, 2)))
        assert values.shape == (0,)
        assert gradients.shape == (0, 2)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize a suite by the filters of its class.

    ``name``: each filter; ``derived``: each whose gradient is the derivative of its values; ``order``: of
    each B-spline; ``scipy_order``: of each that SciPy has too, 1 for trilinear.
    """
    if metafunc.cls is None or not issubclass(metafunc.cls, EveryFilter):
        return
    filters = metafunc.cls.filters
    orders = [order for order in range(2, 7) if f"bspline{order}" in filters]
    values: dict[str, list[str] | list[int]] = {
        "name": list(filters),
        "derived": [name for name in filters if name != "central"],
        "order": orders,
        "scipy_order": [*(1 for name in filters if name == "trilinear"), *(n for n in orders if n < 6)],
    }
    for argument, chosen in values.items():
        if argument in metafunc.fixturenames:
            metafunc.parametrize(argument, chosen)


class TestDouble(EveryFilter):
    tolerance = 2e-14

    def read(self, spline, points):
        return spline.value_and_gradient(points)


class TestSingle(EveryFilter):
    # Both types are read by the same code; compiling it for all filters takes longer than the tests.
    filters = effort(("bspline3", "catmull-rom", "trilinear"), tuple(FILTERS))
    tolerance = 2e-6

    def made(self, volume, name, **how):
        return Spline.from_volume(volume, name, dtype=np.float32, **how)

    def read(self, spline, points):
        assert spline.coefficients.dtype == np.float32
        return spline.value(points), spline.gradient(points)


def test_order_and_name_make_the_same_spline():
    volume = rough_volume(0, (6, 5, 7))
    for order in range(2, 7):
        by_order = Spline(volume, order, smoothing=0.3).coefficients
        assert np.array_equal(
            by_order, Spline.from_volume(volume, f"bspline{order}", smoothing=0.3).coefficients
        )


def test_an_order_may_be_any_kind_of_whole_number():
    volume = rough_volume(0, (6, 5, 7))
    for order in (np.int64(4), 4.0):
        assert np.array_equal(Spline(volume, order).coefficients, Spline(volume, 4).coefficients)


@pytest.mark.parametrize("dtype", [np.float32, "float32", "f4", np.dtype("f4"), "float64", "d", float])
def test_types_are_accepted_under_all_names_of_numpy(dtype):
    volume = rough_volume(0, (6, 5, 7))
    points = np.random.default_rng(1).uniform(0.0, 4.0, (9, 3))
    made, expected = Spline(volume, dtype=dtype), Spline(volume, dtype=np.dtype(dtype).type)
    assert made.coefficients.dtype == np.dtype(dtype)
    assert np.array_equal(made.value(points), expected.value(points))


def test_the_cubic_is_the_default():
    assert Spline(rough_volume(0, (4, 4))).filter.name == "bspline3"


def test_node_0_lies_at_the_pad():
    volume = rough_volume(0, (6, 5, 7))
    spline = Spline(volume, 6, prefilter=False)
    assert spline.shape == (6, 5, 7)
    inside = tuple(slice(spline.pad, spline.pad + n) for n in volume.shape)
    assert np.array_equal(spline.coefficients[inside], volume)
    assert spline.coefficients.flags.c_contiguous


def test_the_volume_is_not_changed():
    volume = rough_volume(0, (6, 5, 7))
    before = volume.copy()
    Spline(volume, 3, smoothing=1.0)
    Spline.from_volume(volume, "trilinear").value(np.zeros((1, 3)))
    assert np.array_equal(volume, before)


def test_whole_numbers_and_other_orders_of_memory_are_read():
    levels = np.random.default_rng(0).integers(0, 255, (5, 6, 7), dtype=np.uint8)
    turned = np.asfortranarray(levels)
    points = np.random.default_rng(1).uniform(0.0, 4.0, (9, 3))
    expected = Spline(levels.astype(float)).value(points)
    assert np.array_equal(Spline(levels).value(points), expected)
    assert np.array_equal(Spline(turned).value(points), expected)


VOLUME = np.zeros((3, 4))
NAN = np.where(np.arange(12).reshape(3, 4) == 6, np.nan, 1.0)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ({"volume": NAN}, r"volume.*nan at node \(1, 2\)"),
        ({"volume": np.full((2, 2), np.inf)}, "volume.*inf"),
        ({"volume": np.zeros((1, 4))}, r"volume.*\(1, 4\)"),
        ({"volume": np.zeros((2, 2, 2, 2))}, r"volume.*\(2, 2, 2, 2\)"),
        ({"volume": np.float64(3.0)}, r"volume.*\(\)"),
        ({"volume": VOLUME, "order": 7}, "order.*7"),
        ({"volume": VOLUME, "order": 1}, "order.*1"),
        ({"volume": VOLUME, "smoothing": -0.1}, "smoothing.*-0.1"),
        ({"volume": VOLUME, "smoothing": float("nan")}, "smoothing.*nan"),
        ({"volume": VOLUME, "smoothing": 1.0, "prefilter": False}, "smoothing"),
        ({"volume": VOLUME, "dtype": np.int32}, "dtype.*int32"),
        ({"volume": VOLUME, "dtype": ">f8"}, "dtype.*>f8"),
        ({"volume": VOLUME, "dtype": "wide"}, "dtype.*wide"),
        ({"volume": np.full((3, 4), 1e300), "dtype": np.float32}, "volume.*float32"),
        ({"volume": 1e308 * (-1.0) ** np.arange(9), "order": 6}, "volume.*float64"),
    ],
)
def test_rejects_invalid_splines(words, named):
    with pytest.raises(InvalidInput, match=named):
        Spline(**words)


def test_unknown_filters_and_smoothing_of_those_that_take_none_are_rejected():
    with pytest.raises(InvalidInput, match=r"filter.*sinc.*catmull-rom"):
        Spline.from_volume(VOLUME, "sinc")
    with pytest.raises(InvalidInput, match="smoothing"):
        Spline.from_volume(VOLUME, "catmull-rom", smoothing=1.0)


@pytest.mark.parametrize("shape", [(3,), (4, 3), (2, 2, 2)])
def test_points_of_another_shape_are_rejected(shape):
    with pytest.raises(InvalidInput, match="points"):
        Spline(VOLUME).value(np.zeros(shape))

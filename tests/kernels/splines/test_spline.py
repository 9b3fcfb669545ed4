"""Every filter by the Spline class, in both types of coefficients; and what the class refuses."""

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.splines import FILTERS, Spline

from ...effort import effort
from .every_filter import EveryFilter, rough_volume


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

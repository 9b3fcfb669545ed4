"""Every filter on an OpenCL device, in both types; and what happens where it cannot be trusted."""

import warnings

import numpy as np
import pytest

from bentray_kernels.opencl import OpenCLFallbackWarning, choice, session_or_warning
from bentray_kernels.splines import FILTERS, Spline, sampling_opencl
from bentray_kernels.splines.sampling_opencl import OpenCLSpline, fault_of, on_the_device

from ...effort import effort
from .every_filter import EveryFilter, rough_volume


@pytest.mark.opencl
class TestDouble(EveryFilter):
    # A kernel is compiled for each filter and type: by day each filter in one of the types.
    filters = effort(("bspline3", "catmull-rom", "trilinear"), tuple(FILTERS))
    tolerance = 2e-14

    def read(self, spline, points):
        return OpenCLSpline(spline, session_or_warning(instead="Spline")).value_and_gradient(points)


@pytest.mark.opencl
class TestSingle(EveryFilter):
    filters = effort(tuple(name for name in FILTERS if name not in TestDouble.filters), tuple(FILTERS))
    tolerance = 2e-6

    def made(self, volume, name, **how):
        return Spline.of(volume, name, dtype=np.float32, **how)

    def read(self, spline, points):
        there = OpenCLSpline(spline, session_or_warning(instead="Spline"))
        return there.value(points), there.gradient(points)


@pytest.mark.opencl
def test_many_points_are_read_in_parts(monkeypatch):
    spline = Spline(rough_volume(0, (6, 5, 7)))
    points = np.random.default_rng(0).uniform(0.0, 5.0, (50, 3))
    there = on_the_device(spline)
    whole = there.value_and_gradient(points)
    monkeypatch.setattr(type(there.session), "doubles_at_once", lambda session: 7 * 8)  # 8 points
    for part, all_at_once in zip(there.value_and_gradient(points), whole, strict=True):
        assert np.array_equal(part, all_at_once)


def test_without_a_device_the_spline_itself_answers(monkeypatch):
    monkeypatch.setattr(choice, "_found", lambda *_: "this machine has no OpenCL device")
    choice._warn_once.cache_clear()
    spline = Spline(rough_volume(0, (6, 5)))
    with pytest.warns(OpenCLFallbackWarning, match="Spline takes over: this machine has no"):
        assert on_the_device(spline) is spline
    choice._warn_once.cache_clear()


@pytest.mark.opencl
def test_a_device_that_reads_wrong_is_left_with_a_warning(monkeypatch):
    spline = Spline(rough_volume(0, (6, 5)))
    right = OpenCLSpline.value_and_gradient

    def wrong(there, points):
        values, gradients = right(there, points)
        return values + 1e-9, gradients

    monkeypatch.setattr(sampling_opencl.OpenCLSpline, "value_and_gradient", wrong)
    with pytest.warns(OpenCLFallbackWarning, match=r"reads bspline3 wrong.*off by"):
        assert on_the_device(spline) is spline


@pytest.mark.opencl
def test_a_field_of_noughts_is_read_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert fault_of(on_the_device(Spline(np.zeros((4, 4, 4))))) == ""

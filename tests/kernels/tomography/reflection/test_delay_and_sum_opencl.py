"""Delay and sum on an OpenCL device: the sums of compiled code, in any part and again."""

import numpy as np
import pytest

from bentray_kernels.opencl import OpenCLFallbackWarning
from bentray_kernels.tomography.reflection import delay_and_sum_opencl
from bentray_kernels.tomography.reflection.delay_and_sum import Signals, sum_echoes
from bentray_kernels.tomography.reflection.delay_and_sum_opencl import sum_echoes_opencl

from .test_delay_and_sum import SPACING, made

EVERYONE = np.arange(24)


def arguments(signals, times, pixels, emissions=EVERYONE, angle=90.0):
    some = Signals(signals.parts[emissions], signals.used[emissions], signals.first_s, signals.rate_hz)
    return some, times, SPACING, EVERYONE[emissions], EVERYONE, pixels, angle


def assert_equal(found, expected, part=1e-4):
    for one, other in zip(found, expected, strict=True):
        assert one.dtype == other.dtype
        assert np.abs(one - other).max() <= part * np.abs(other).max()


@pytest.mark.opencl
@pytest.mark.parametrize("angle", [90.0, 40.0])
def test_sums_are_those_of_compiled_code(angle):
    scan = made()
    given = arguments(*scan, angle=angle)
    found, expected = sum_echoes_opencl(*given), sum_echoes(*given)
    assert_equal(found, expected)
    outside = ~scan[2].inside
    assert not any(one[outside].any() for one in found)
    for one, again in zip(found, sum_echoes_opencl(*given), strict=True):
        np.testing.assert_array_equal(one, again)


@pytest.mark.opencl
def test_parts_of_pixels_and_of_emissions_have_the_same_bits(monkeypatch):
    scan = made()
    whole = sum_echoes_opencl(*arguments(*scan))
    monkeypatch.setattr(delay_and_sum_opencl, "PIXELS", 128)
    for one, other in zip(sum_echoes_opencl(*arguments(*scan)), whole, strict=True):
        np.testing.assert_array_equal(one, other)
    some = np.array([3, 11, 20])
    assert_equal(sum_echoes_opencl(*arguments(*scan, some)), sum_echoes(*arguments(*scan, some)))


def test_compiled_code_computes_without_a_device(monkeypatch):
    monkeypatch.setenv("BENTRAY_OPENCL_DEVICE", "none")
    given = arguments(*made())
    monkeypatch.setattr(delay_and_sum_opencl, "session_or_warning", lambda instead: None)
    for one, other in zip(sum_echoes_opencl(*given), sum_echoes(*given), strict=True):
        np.testing.assert_array_equal(one, other)
    assert issubclass(OpenCLFallbackWarning, UserWarning)

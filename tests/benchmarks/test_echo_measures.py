"""Measures of reflection images on images that are known: a Gaussian spot, a line, a cyst."""

import numpy as np
import pytest
from benchmarks.reflection._echo_measures import axes_of, cyst_contrast, echo_near, line_offset

from bentray_kernels.tomography.result import Reflection

STEP, FIRST = 2e-4, (-0.011, -0.009)


def image(size):
    """An image with an envelope ``size(x, y)``, m."""
    empty = Reflection(np.zeros((111, 93)), (STEP, STEP), FIRST)
    values = np.maximum(size(*axes_of(empty)), 1e-5)
    return Reflection(20.0 * np.log10(values / values.max()), (STEP, STEP), FIRST)


def spot(x, y, position, sigma):
    return np.exp(-((x - position[0]) ** 2 + (y - position[1]) ** 2) / (2.0 * sigma**2))


def test_place_and_width_of_a_spot_between_pixels():
    point, sigma = (0.00313, -0.00252), 6e-4
    echo = echo_near(
        image(lambda x, y: spot(x, y, point, sigma) + 2.0 * spot(x, y, (-0.006, 0.0), 3e-4)), point, 3e-3
    )
    assert echo.away_m < 0.1 * STEP
    assert echo.width_m == pytest.approx(2.0 * sigma * np.sqrt(2.0 * np.log(2.0)), rel=0.04)


def test_error_of_place_is_the_distance_of_the_brightest_echo():
    made = image(lambda x, y: spot(x, y, (0.001, 0.002), 5e-4))
    assert echo_near(made, (0.001, 0.0005), 3e-3).away_m == pytest.approx(0.0015, abs=0.1 * STEP)


def test_offset_of_a_line():
    made = image(lambda x, y: np.exp(-(((y - 0.0018) / 4e-4) ** 2)) + 0.0 * x)
    assert line_offset(made, ((-0.004, 0.001), (0.003, 0.001)), 2e-3) == pytest.approx(8e-4, abs=0.6 * STEP)


def test_contrast_of_a_cyst():
    made = image(lambda x, y: np.where(np.hypot(x - 0.002, y) < 0.003, 0.1, 1.0))
    assert cyst_contrast(made, (0.002, 0.0), 0.003) == pytest.approx(10.0, rel=1e-6)
    assert cyst_contrast(image(lambda x, y: 1.0 + 0.0 * x * y), (0.002, 0.0), 0.003) == pytest.approx(1.0)

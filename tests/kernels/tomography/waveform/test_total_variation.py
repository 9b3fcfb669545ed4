"""Total variation: its slope against differences, what it counts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.tomography.waveform.total_variation import variation, weight


@given(seed=st.integers(0, 2**32 - 1), flat=st.floats(0.1, 5.0))
def test_slope_is_that_of_finite_differences(seed, flat):
    rng = np.random.default_rng(seed)
    image, way = 10.0 * rng.standard_normal((2, 6, 7))
    small = 1e-5
    rise = variation(image + small * way, flat)[0] - variation(image - small * way, flat)[0]
    found = (variation(image, flat)[1] * way).sum()
    assert found == pytest.approx(rise / (2.0 * small), rel=1e-5, abs=1e-6)


def test_a_flat_image_has_none_and_an_edge_counts_by_its_height():
    image = np.full((9, 8), 1500.0)
    value, slope = variation(image, 1e-3)
    assert value == 0.0
    assert not slope.any()
    image[4:] += 40.0
    assert variation(image, 1e-3)[0] == pytest.approx(40.0 * 7, rel=1e-3)


def test_the_weight_makes_it_as_large_as_asked_and_is_finite_without_any():
    image = 1500.0 + 20.0 * np.random.default_rng(0).standard_normal((9, 8))
    assert weight(image, 0.3) * variation(image)[0] == pytest.approx(0.3)
    assert 0.0 < weight(np.full((9, 8), 1500.0), 0.3) < 1.0

"""ACCC over a range of iso-values equals equation 18 for each of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.isosurface.accc import product_ranges, weighted_range
from bentray_kernels.isosurface.cell_weights import cell_weights
from bentray_kernels.splines.filters import FILTERS

from ...effort import effort


def equation_18(nodes: np.ndarray, iso: float, least: np.ndarray, most: np.ndarray) -> tuple[float, float]:
    """Lower and upper bound about one iso-value."""
    apart = nodes - iso
    upper = iso + (apart * np.where(apart >= 0.0, most, least)).sum()
    lower = iso + (apart * np.where(apart >= 0.0, least, most)).sum()
    return lower, upper


@pytest.mark.parametrize("name", ["trilinear", "bspline2", "bspline3", "bspline4"])
def test_the_range_classifies_as_equation_18_does(name):
    weights = cell_weights(FILTERS[name])
    least, most = product_ranges(weights, 1)

    @given(seed=st.integers(0, 2**32 - 1), position=st.floats(-0.2, 1.2))
    @settings(max_examples=effort(20, 200), deadline=None)
    def same(seed, position):
        nodes = np.random.default_rng(seed).normal(0.0, 1.0, weights.nodes**3)
        low, high = weighted_range(nodes, least, most)
        iso = nodes.min() + position * np.ptp(nodes)
        lower, upper = equation_18(nodes, iso, least[0], most[0])
        if min(abs(upper - iso), abs(iso - lower)) > 1e-9:
            assert (low <= iso <= high) == (lower <= iso <= upper)

    same()


def test_parts_of_a_cell_cover_it():
    weights = cell_weights(FILTERS["bspline3"])
    whole, parts = product_ranges(weights, 1), product_ranges(weights, 2)
    assert parts[0].shape == (8, 64)
    np.testing.assert_allclose(parts[0].min(axis=0), whole[0][0])
    np.testing.assert_allclose(parts[1].max(axis=0), whole[1][0])

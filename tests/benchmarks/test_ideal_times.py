"""Ideal times: those of an independent, finer solver of the same phantom, on truths coarse and fine."""

import numpy as np
import pytest
from benchmarks.acquisition._ideal_times import ideal

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6

ELEMENTS = 8


@pytest.mark.parametrize(
    ("nodes", "radius_m"), [pytest.param(160, 0.09, marks=pytest.mark.nightly), (160, 0.102)]
)
def test_ideal_times_match_the_phantom(nodes, radius_m):
    """In water as fast as fat, for steps of edges shape shadows; the wider ring lies beyond the truth."""
    phantom, everyone = table6(1375.0), np.arange(ELEMENTS)
    ring = Ring(ELEMENTS, radius_m)
    side = max(TABLE6_SIDE_M, 2.05 * radius_m)
    expected = TravelTimeScan(phantom, ring, side, nodes=nodes).delta_tof(everyone)
    spacing = TABLE6_SIDE_M / (nodes - 1)
    truth = Truth(
        phantom.speed(nodes, TABLE6_SIDE_M), (spacing, spacing), (-0.5 * TABLE6_SIDE_M, -0.5 * TABLE6_SIDE_M)
    )
    dataset = Dataset(ring.positions(), everyone, everyone, 1375.0, delta_tof_s=expected, truth=truth)
    computed = ideal(dataset)
    far = dataset.distance_m() > 0.05
    assert np.abs(computed - expected)[far].max() < 1e-7
    assert np.abs(expected[far]).max() > 1e-6

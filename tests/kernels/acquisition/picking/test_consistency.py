"""Inconsistent picks: only these go."""

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.picking.consistency import consistent

from ..traces import ring, smooth_delay

HALF_PERIOD_S = 0.5e-6


def scan(delta, rx=None):
    elements = np.arange(len(delta))
    receivers = elements if rx is None else rx
    return Dataset(ring(len(delta)), elements, receivers, 1480.0, delta_tof_s=delta)


def test_smooth_picks_all_stay():
    delta = smooth_delay(32, 2e-6)
    np.testing.assert_array_equal(consistent(scan(delta), delta, HALF_PERIOD_S), delta)


def test_noise_below_half_a_period_stays():
    noise = np.random.default_rng(0).uniform(-0.2e-6, 0.2e-6, (32, 32))
    assert np.isfinite(consistent(scan(noise), noise, HALF_PERIOD_S)).all()


def test_only_isolated_cycle_skips_are_removed():
    delta = np.zeros((32, 32))
    delta[3, 20], delta[9, 28], delta[15, 2] = 1e-6, -1e-6, 5e-6
    kept = consistent(scan(delta), delta, HALF_PERIOD_S)
    assert np.isnan(kept[[3, 9, 15], [20, 28, 2]]).all()
    assert np.isnan(kept).sum() == 3
    assert np.isfinite(delta).all()


def test_missing_neighbours_are_ignored():
    delta = np.full((16, 16), np.nan)
    delta[2, 9] = 3e-6
    kept = consistent(scan(delta), delta, HALF_PERIOD_S)
    assert kept[2, 9] == 3e-6
    assert np.isnan(kept).sum() == 255


def test_the_reverse_must_agree():
    delta = np.zeros((32, 32))
    delta[4:12, 16:26] = 0.8e-6
    kept = consistent(scan(delta), delta, HALF_PERIOD_S)
    assert np.isnan(kept[6:10, 18:24]).all()
    assert np.isnan(kept[18:24, 6:10]).all()


def test_elements_are_neighbours_by_place_not_by_number():
    order = np.random.default_rng(2).permutation(32)
    delta = smooth_delay(32, 2e-6)
    position = ring(32)
    shuffled = Dataset(
        position, order, order[::-1].copy(), 1480.0, delta_tof_s=delta[np.ix_(order, order[::-1])]
    )
    kept = consistent(shuffled, shuffled.delta_tof_s, HALF_PERIOD_S)
    assert np.isfinite(kept).all()

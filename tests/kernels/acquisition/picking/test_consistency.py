"""Inconsistent picks: only these go."""

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.picking.consistency import consistent

from ..traces import blob_delay, ring, smooth_delay

FREQUENCY_HZ = 1.0e6


def scan(delta, rx=None, frequency=FREQUENCY_HZ):
    elements = np.arange(len(delta))
    receivers = elements if rx is None else rx
    position = ring(len(delta))
    return Dataset(position, elements, receivers, 1480.0, delta_tof_s=delta, center_frequency_hz=frequency)


def test_smooth_picks_all_stay():
    delta = smooth_delay(32, 2e-6)
    np.testing.assert_array_equal(consistent(scan(delta), delta), delta)


def test_noise_below_half_a_period_stays():
    noise = np.random.default_rng(0).uniform(-0.2e-6, 0.2e-6, (32, 32))
    assert np.isfinite(consistent(scan(noise), noise)).all()


def test_only_isolated_cycle_skips_are_removed():
    delta = np.zeros((32, 32))
    delta[3, 20], delta[9, 28], delta[15, 2] = 1e-6, -1e-6, 5e-6
    kept = consistent(scan(delta), delta)
    assert np.isnan(kept[[3, 9, 15], [20, 28, 2]]).all()
    assert np.isnan(kept).sum() == 3
    assert np.isfinite(delta).all()


def test_missing_neighbours_are_ignored():
    delta = np.full((16, 16), np.nan)
    delta[2, 9] = 3e-6
    kept = consistent(scan(delta), delta)
    assert kept[2, 9] == 3e-6
    assert np.isnan(kept).sum() == 255


def test_the_reverse_must_agree():
    delta = np.zeros((32, 32))
    delta[4:12, 16:26] = 0.8e-6
    kept = consistent(scan(delta), delta)
    assert np.isnan(kept[6:10, 18:24]).all()
    assert np.isnan(kept[18:24, 6:10]).all()


def test_elements_are_neighbours_by_place_not_by_number():
    order = np.random.default_rng(2).permutation(32)
    delta = smooth_delay(32, 2e-6)
    position = ring(32)
    shuffled = Dataset(
        position,
        order,
        order[::-1].copy(),
        1480.0,
        delta_tof_s=delta[np.ix_(order, order[::-1])],
        center_frequency_hz=FREQUENCY_HZ,
    )
    kept = consistent(shuffled, shuffled.delta_tof_s)
    assert np.isfinite(kept).all()


@pytest.mark.parametrize("frequency", [FREQUENCY_HZ, None])
@pytest.mark.parametrize("name", ["blob", "edge"])
def test_refraction_alone_leaves_out_nothing(frequency, name):
    """At the edge of an object most neighbours have the time of water, and the pick itself has not."""
    delta = blob_delay(64)
    if name == "edge":
        position = ring(64)
        middle = 0.5 * (position[:, None] + position[None])
        delta = np.where(np.linalg.norm(middle, axis=-1) < 0.021, 8e-7, 0.0)
    np.testing.assert_array_equal(consistent(scan(delta, frequency=frequency), delta), delta)


@pytest.mark.parametrize("share", [0.02, 0.1])
@pytest.mark.parametrize("size_s", [1.5e-6, 4e-6])
def test_without_a_frequency_the_others_tell_wrong_picks(share, size_s):
    random, delta = np.random.default_rng(3), blob_delay(64)
    wrong = (random.random(delta.shape) < share) & ~np.eye(64, dtype=bool)
    picks = np.where(wrong, delta + random.choice([-size_s, size_s], delta.shape), delta)
    left = np.isnan(consistent(scan(picks, frequency=None), picks))
    assert left[wrong].mean() > 0.93
    # The reverse of a wrong pick that passed is left out with it.
    assert not left[~wrong & ~wrong.T].any()


def test_noise_is_no_fault_without_a_frequency():
    picks = blob_delay(96) + 1e-6 * np.random.default_rng(4).standard_normal((96, 96))
    assert np.isfinite(consistent(scan(picks, frequency=None), picks)).all()


def test_a_region_that_no_path_explains_is_left_out():
    """Neighbours and reverses agree: picks at the begin of the recording."""
    delta = blob_delay(64)
    distance = scan(delta).distance_m()
    region = np.zeros_like(delta, dtype=bool)
    region[5:14, 35:44] = region[35:44, 5:14] = True
    picks = np.where(region, 2e-6 - distance / 1480.0, delta)
    left = np.isnan(consistent(scan(picks, frequency=None), picks))
    np.testing.assert_array_equal(left, region)

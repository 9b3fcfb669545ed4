"""Pairs of slices, of rings in space and of a ring that moves: the same data by any name."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.pairs import count, from_dataset, heights
from bentray_kernels.tomography.problem import Problem

from ..straight_scans import ring_scan

RING, Z, WATER = Ring(6, 0.05), np.array([-0.004, 0.0, 0.004]), 1500.0
SLICES, VOLUME = (Settings(method="sart", decomposition=way) for way in ("slices", "volume"))


def moved():
    delta = np.random.default_rng(0).normal(0.0, 1e-7, (3, 6, 6))
    return ring_scan(6, 0.05, delta, slice_z_m=Z)


def rings():
    """Elements at all heights at once; times within a ring are those of ``moved``."""
    everyone = np.arange(18)
    delta = np.random.default_rng(1).normal(0.0, 1e-7, (18, 18))
    for k, within in enumerate(moved().delta_tof_s):
        delta[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = within
    position = np.concatenate([np.column_stack((RING.positions(), np.full(6, z))) for z in Z])
    return Dataset(position, everyone, everyone, WATER, delta_tof_s=delta, array_type="rings")


def test_noise_is_measured_where_pairs_were_measured_both_ways():
    random, everyone = np.random.default_rng(2), np.arange(64)
    one_way = random.normal(0.0, 1e-6, (64, 64))
    delta = one_way + one_way.T + random.normal(0.0, 1e-8, (64, 64))
    both = ring_scan(64, 0.05, delta)
    assert from_dataset(both, SLICES, 0).noise_s == pytest.approx(1e-8, rel=0.05)
    once = replace(both, delta_tof_s=np.where(everyone[:, None] < everyone, delta, np.nan))
    assert from_dataset(once, SLICES, 0).noise_s == 0.0
    # Two times have a mean of half the variance; one that is filled in from its reverse has not.
    problem = Problem.from_dataset(both, SLICES.changed(nodes=32), 0)
    assert problem.each_pair_once().noise_s == pytest.approx(problem.noise_s / np.sqrt(2.0))
    assert problem.each_pair_once().each_pair_once().noise_s == problem.each_pair_once().noise_s


def test_heights_are_those_of_slices_and_rings():
    assert np.array_equal(heights(moved()), Z)
    assert np.allclose(heights(rings()), Z)
    assert heights(moved().slice(0)) is None


def test_rings_in_space_fall_into_the_slices_of_a_ring_that_moves():
    assert count(moved(), SLICES) == count(rings(), SLICES) == 3
    for k in range(3):
        a, b = from_dataset(moved(), SLICES, k), from_dataset(rings(), SLICES, k)
        assert np.array_equal(a.emitters, b.emitters)
        assert np.array_equal(a.receivers, b.receivers)
        assert np.array_equal(a.delta_tof, b.delta_tof, equal_nan=True)


def test_a_volume_has_every_emitter_at_its_height():
    apart, together = from_dataset(moved(), VOLUME, 0), from_dataset(rings(), VOLUME, 0)
    assert count(moved(), VOLUME) == 1
    assert np.array_equal(apart.emitters, together.emitters)
    assert apart.delta_tof.shape == (18, 6)
    assert together.delta_tof.shape == (18, 18)
    assert np.array_equal(apart.ring, np.repeat([0, 1, 2], 6))
    assert np.array_equal(apart.receivers[1][:, 2], np.zeros(6))
    # What a moved ring hears is what the rings hear of their own.
    for row in range(18):
        own = slice(6 * apart.ring[row], 6 * apart.ring[row] + 6)
        assert np.array_equal(apart.delta_tof[row], together.delta_tof[row, own], equal_nan=True)


def test_reverses_fill_gaps_ring_by_ring():
    gap = moved()
    gap.delta_tof_s[1, 2, 4] = np.nan
    result = from_dataset(gap, VOLUME, 0)
    assert result.delta_tof[6 + 2, 4] == gap.delta_tof_s[1, 4, 2]


def test_invalid_pairs_have_neither_time_nor_amplitude():
    valid = np.ones((3, 6, 6), bool)
    valid[0, 1, 2] = valid[0, 2, 1] = False
    loud = replace(moved(), valid=valid, log_ratio_np=np.ones((3, 6, 6)))
    result = from_dataset(loud, SLICES, 0)
    assert np.isnan(result.delta_tof[1, 2])
    assert np.isnan(result.log_ratio[1, 2])


def test_an_uneven_ring_is_one_ring():
    """Steps of 8 µm, the highest element nearer to the next ring's lowest than to its own."""
    uneven = rings()
    uneven.element_position_m[:, 2] = 8e-6 * np.tile(np.arange(6), 3) + np.repeat([0.0, 5.5e-5, 1.1e-4], 6)
    assert count(uneven, SLICES) == 3
    for k in range(3):
        assert np.array_equal(
            from_dataset(uneven, SLICES, k).delta_tof,
            from_dataset(moved(), SLICES, k).delta_tof,
            equal_nan=True,
        )


def test_one_height_is_no_volume():
    with pytest.raises(InvalidInput, match=r"^decomposition: found"):
        from_dataset(moved().slice(0), VOLUME, 0)


def test_an_array_in_space_that_moves_is_rejected():
    both = replace(rings(), delta_tof_s=np.zeros((2, 18, 18)), slice_z_m=np.array([0.0, 0.1]))
    with pytest.raises(InvalidInput, match=r"^slice/z_m: found"):
        count(both, VOLUME)


@pytest.mark.parametrize("dataset", [moved(), rings()], ids=["moved", "rings"])
def test_a_ring_without_times_is_named(dataset):
    delta = dataset.delta_tof_s.copy()
    delta[(1,) if delta.ndim == 3 else (slice(6, 12), slice(6, 12))] = np.nan
    with pytest.raises(InvalidInput, match="slice 1"):
        from_dataset(replace(dataset, delta_tof_s=delta), SLICES, 1)

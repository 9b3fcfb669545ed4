"""Input of the peers: pairs, elements, grid and starting speed."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.reconstruction._travel_times import TravelTimes

from .._small_ring import ELEMENTS, NODES, SIDE_M, WATER_MPS, dataset, ring


def test_each_pair_comes_once_and_with_the_mean_of_both_ways() -> None:
    scan = dataset()
    assert scan.delta_tof_s is not None
    one_way = np.triu(np.full((ELEMENTS, ELEMENTS), 2e-8))
    times = TravelTimes.from_dataset(replace(scan, delta_tof_s=scan.delta_tof_s + one_way), NODES, SIDE_M)
    emitter, receiver = times.pairs()
    assert len({frozenset(pair) for pair in zip(emitter, receiver, strict=True)}) == len(emitter)
    assert len(emitter) == ELEMENTS * (ELEMENTS - 1) // 2
    assert times.delta_tof[emitter, receiver] == pytest.approx(scan.delta_tof_s[emitter, receiver] + 1e-8)


def test_pairs_measured_in_one_direction_alone_are_kept() -> None:
    scan, few = dataset(), np.arange(0, ELEMENTS, 4)
    times = TravelTimes.from_dataset(replace(scan, tx=few, delta_tof_s=scan.delta_tof_s[few]), NODES, SIDE_M)
    emitter, receiver = times.pairs()
    pairs = {frozenset(pair) for pair in zip(few[emitter], receiver, strict=True)}
    assert len(pairs) == len(emitter) == len(few) * (ELEMENTS - 1) - len(few) * (len(few) - 1) // 2
    assert times.emitters == pytest.approx(times.receivers[few])
    assert times.delta_tof[emitter, receiver] == pytest.approx(scan.delta_tof_s[few[emitter], receiver])


def test_every_emitter_keeps_about_as_many_pairs() -> None:
    of_emitter = np.isfinite(ring().delta_tof).sum(axis=1)
    assert set(of_emitter) == {(ELEMENTS - 1) // 2, ELEMENTS // 2}


def test_elements_lie_in_the_grid_and_the_region_among_them() -> None:
    times = ring()
    assert times.emitters.min() > 0.0
    assert times.emitters.max() < times.side_m == pytest.approx(SIDE_M)
    nodes = np.argwhere(times.region) * times.spacing
    gap = np.linalg.norm(nodes[:, None] - times.emitters[None], axis=-1).min()
    assert times.spacing < gap < 4.0 * times.spacing


def test_the_speed_follows_the_slowness_in_the_region() -> None:
    times = ring()
    speed = times.speed(np.full(np.count_nonzero(times.region), 1.0 / 1400.0 - 1.0 / WATER_MPS))
    assert speed[times.region] == pytest.approx(1400.0)
    assert speed[~times.region] == pytest.approx(WATER_MPS)

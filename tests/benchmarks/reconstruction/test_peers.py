"""Peers of tomography: their input, straight-ray ones on a disc of known times, and installed ones."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.reconstruction._straight_ray_peers import cgls, roughness, sart, sirt, straight_matrix
from benchmarks.reconstruction._tomography_peers import PEERS, installed
from benchmarks.reconstruction._travel_times import TravelTimes

from .._small_ring import DISC_MPS, ELEMENTS, NODES, SIDE_M, WATER_MPS, dataset, disc, ring


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


def test_a_row_is_as_long_as_its_ray_where_all_nodes_may_change() -> None:
    times = ring()
    times = replace(times, region=np.ones_like(times.region))
    emitter, receiver = times.pairs()
    length = np.linalg.norm(times.emitters[emitter] - times.receivers[receiver], axis=1)
    assert straight_matrix(times).sum(axis=1) == pytest.approx(length, rel=1e-12)


def test_a_row_integrates_a_linear_image_exactly() -> None:
    times = ring()
    times = replace(times, region=np.ones_like(times.region))
    axis = np.arange(len(times.region)) * times.spacing
    image = 1.0 + 3.0 * axis[:, None] - 2.0 * axis[None, :]
    emitter, receiver = times.pairs()
    ends = times.emitters[emitter], times.receivers[receiver]
    middle = 0.5 * (ends[0] + ends[1])
    exact = np.linalg.norm(ends[0] - ends[1], axis=1) * (1.0 + middle @ (3.0, -2.0))
    assert straight_matrix(times) @ image.ravel() == pytest.approx(exact, rel=1e-12)


def test_roughness_is_the_integral_of_the_squared_gradient() -> None:
    times = ring()
    axis = np.arange(len(times.region)) * times.spacing
    image = np.broadcast_to(5.0 * axis[:, None], times.region.shape)[times.region]
    count = np.isfinite(times.delta_tof).sum()
    rough = roughness(times, 0.1) @ image
    area = times.region.sum() * times.spacing**2
    assert rough @ rough == pytest.approx(25.0 * area * (0.1 * times.side_m) ** 2 * count, rel=0.1)
    assert np.abs(roughness(times, 1.0) @ np.ones(times.region.sum())).max() == 0.0


@pytest.mark.parametrize("method", [cgls, sirt, sart])
def test_water_stays_water(method) -> None:  # type: ignore[no-untyped-def]
    times = ring()
    still: TravelTimes = replace(times, delta_tof=0.0 * times.delta_tof)
    assert method(still) == pytest.approx(np.full(times.region.shape, times.water_speed))


@pytest.mark.parametrize("name", list(PEERS))
def test_a_peer_finds_a_disc(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a peer's own are its own affair
        peers, missing = installed()
        if name in missing:
            pytest.skip(missing[name])
        times = ring()
        speed = peers[name](times)
    assert speed.shape == times.region.shape
    assert np.isfinite(speed).all()
    part, off_mps = (0.6, 8.0) if name.startswith("straight") else (0.5, 12.0)
    assert speed[disc(times, part)].mean() == pytest.approx(DISC_MPS, abs=off_mps)
    outside = ~times.region if name.startswith("straight") else (0, 0)
    assert speed[outside] == pytest.approx(WATER_MPS)

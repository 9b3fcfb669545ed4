"""Straight-ray peers, on a disc whose travel times are known."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.reconstruction._straight_ray_peers import cgls, roughness, sart, sirt, straight_matrix
from benchmarks.reconstruction._travel_times import TravelTimes

from .._small_ring import DISC_MPS, disc, ring


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
def test_a_disc_is_found(method) -> None:  # type: ignore[no-untyped-def]
    times = ring()
    speed = method(times)
    inside = disc(times, 0.6)
    assert speed[inside].mean() == pytest.approx(DISC_MPS, abs=8.0)
    assert speed[~times.region] == pytest.approx(times.water_speed)


@pytest.mark.parametrize("method", [cgls, sirt, sart])
def test_water_stays_water(method) -> None:  # type: ignore[no-untyped-def]
    times = ring()
    still: TravelTimes = replace(times, delta_tof=0.0 * times.delta_tof)
    assert method(still) == pytest.approx(np.full(times.region.shape, times.water_speed))

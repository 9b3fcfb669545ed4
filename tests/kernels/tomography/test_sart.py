"""Eikonal-SART: what it recovers, what it leaves alone, and that cutting the work changes no bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation import Ring, TravelTimeScan
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import (
    Settings,
    SliceProblem,
    advance,
    begin,
    mean_absolute_error,
    reconstruct,
    rmse,
)
from bentray_kernels.tomography.sart import emitter_order, propagation_speed

NODES, SIDE, WATER = 64, TABLE6_SIDE_M, 1375.0
PHANTOM = table6(WATER)
RING = Ring(64, 0.09)


@pytest.fixture(scope="module")
def scan():
    data = TravelTimeScan(PHANTOM, RING, SIDE, nodes=NODES)
    everyone = np.arange(RING.elements)
    return Dataset(RING.positions(), everyone, everyone, WATER, delta_tof_s=data.delta_tof(everyone))


def plan(**changes):
    return Settings(nodes=NODES, side_m=SIDE, **changes)


def test_bent_rays_beat_straight_ones(scan):
    truth, inside = PHANTOM.speed(NODES, SIDE), PHANTOM.inside(NODES, SIDE)
    bent = reconstruct(scan, plan())
    straight = reconstruct(scan, plan(rays="straight"))
    assert rmse(bent.speed, truth, inside) < 0.7 * rmse(straight.speed, truth, inside)
    assert mean_absolute_error(bent.speed, truth, inside, 185.0) < 0.08
    rms = [sweep.residual_rms_s for sweep in bent.history]
    assert rms[-1] < 0.2 * rms[0]


def test_uniform_medium_is_recovered_exactly(scan):
    """A scan of nothing but water stays water; one of another speed inside the ring is found."""
    nothing = replace(scan, delta_tof_s=np.zeros_like(scan.delta_tof_s))
    for kind in ("curved", "straight"):
        result = reconstruct(nothing, plan(rays=kind, sweeps=1))
        assert np.allclose(result.speed, WATER, rtol=1e-9)
    warmer = replace(scan, delta_tof_s=scan.distance_m() * (1 / (WATER + 5.0) - 1 / WATER))
    result = reconstruct(warmer, plan(rays="straight", sweeps=8, relaxation=0.5))
    middle = slice(NODES // 4, 3 * NODES // 4)
    assert np.allclose(result.speed[middle, middle], WATER + 5.0, atol=1.5)


@given(cuts=st.lists(st.integers(1, 40), min_size=1, max_size=8))
@settings(max_examples=8, deadline=None)
def test_cutting_the_work_changes_no_bit(cuts):
    rng = np.random.default_rng(0)
    ring = Ring(16, 0.08)
    everyone = np.arange(16)
    delta = rng.normal(0.0, 2e-7, (16, 16))
    dataset = Dataset(ring.positions(), everyone, everyone, WATER, delta_tof_s=delta)
    wanted = Settings(nodes=24, sweeps=2)
    problem = SliceProblem.of(dataset, wanted)
    whole = begin(problem)
    while not whole.done:
        whole = advance(problem, wanted, whole, 10**6)
    cut, k = begin(problem), 0
    while not cut.done:
        cut = advance(problem, wanted, cut, cuts[k % len(cuts)])
        k += 1
    assert np.array_equal(whole.slowness, cut.slowness)
    assert np.array_equal(whole.coverage, cut.coverage)
    assert whole.history == cut.history


def test_same_seed_same_bits_other_seed_other_order(scan):
    a, b = reconstruct(scan, plan(sweeps=1)), reconstruct(scan, plan(sweeps=1))
    c = reconstruct(scan, plan(sweeps=1, seed=1))
    assert np.array_equal(a.speed, b.speed)
    assert not np.array_equal(a.speed, c.speed)


def test_every_pass_slice_and_seed_has_an_order_of_its_own(scan):
    problem = SliceProblem.of(scan, plan())
    orders = [emitter_order(problem, *which) for which in ((0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0))]
    assert len({tuple(order) for order in orders}) == 4
    assert all(sorted(order) == list(range(RING.elements)) for order in orders)


def test_numbering_of_the_elements_does_not_matter(scan):
    """Other numbers for the same elements give the same image, up to the random order of emitters."""
    shuffle = np.random.default_rng(3).permutation(RING.elements)
    renamed = replace(
        scan,
        element_position_m=scan.element_position_m[shuffle],
        delta_tof_s=scan.delta_tof_s[np.ix_(shuffle, shuffle)],
    )
    a, b = reconstruct(scan, plan()), reconstruct(renamed, plan())
    assert rmse(a.speed, b.speed, np.ones_like(a.speed, bool)) < 1.0


def test_half_a_matrix_is_enough_with_reciprocity(scan):
    truth, inside = PHANTOM.speed(NODES, SIDE), PHANTOM.inside(NODES, SIDE)
    upper = np.where(np.triu(np.ones(scan.delta_tof_s.shape, bool), 1), scan.delta_tof_s, np.nan)
    half = replace(scan, delta_tof_s=upper)
    whole = rmse(reconstruct(scan, plan()).speed, truth, inside)
    assert rmse(reconstruct(half, plan()).speed, truth, inside) < 1.1 * whole


def test_missing_data_degrade_gracefully(scan):
    truth, inside = PHANTOM.speed(NODES, SIDE), PHANTOM.inside(NODES, SIDE)
    kept = np.random.default_rng(1).random(scan.delta_tof_s.shape) < 0.1
    sparse = replace(scan, valid=kept)
    nothing = rmse(np.full_like(truth, WATER), truth, inside)
    assert rmse(reconstruct(sparse, plan()).speed, truth, inside) < 0.6 * nothing


def test_water_outside_the_ring_stays_water(scan):
    result = reconstruct(scan, plan(sweeps=1))
    axis = (np.arange(NODES) / (NODES - 1) - 0.5) * SIDE
    outside = np.hypot(axis[:, None], axis[None, :]) > RING.radius_m
    assert np.allclose(result.speed[outside], WATER)


def test_bounds_hold(scan):
    result = reconstruct(scan, plan(sweeps=2, speed_bounds_mps=(1370.0, 1440.0)))
    assert result.speed.min() >= 1370.0 - 1e-9
    assert result.speed.max() <= 1440.0 + 1e-9


def test_stopping_rule_ends_early(scan):
    result = reconstruct(scan, plan(sweeps=50, stop_rms_s=3e-7))
    assert len(result.history) < 50
    assert result.history[-1].residual_rms_s <= 3e-7
    assert result.history[-2].residual_rms_s > 3e-7


def test_data_driven_update_stretches_the_range():
    region = np.ones((4, 4), bool)
    region[0] = False
    slowness = 1.0 / np.linspace(1480.0, 1520.0, 16).reshape(4, 4)
    wanted = Settings(speed_update="data-driven", speed_range_mps=(1375.0, 1560.0))
    stretched = propagation_speed(slowness, region, wanted, warm=True)
    assert stretched[region].min() == pytest.approx(1375.0)
    assert stretched[region].max() == pytest.approx(1560.0)
    assert np.allclose(stretched[0], 1.0 / slowness[0])
    assert np.allclose(propagation_speed(slowness, region, wanted, warm=False), 1.0 / slowness)
    flat = np.full((4, 4), 1 / 1500.0)
    assert np.allclose(propagation_speed(flat, region, wanted, warm=True), 1500.0)


def test_slices_equal_their_single_scans(scan):
    stacked = replace(
        scan,
        delta_tof_s=np.stack([scan.delta_tof_s, 0.5 * scan.delta_tof_s]),
        slice_z_m=np.array([0.0, 0.004]),
    )
    volume = reconstruct(stacked, plan(sweeps=1))
    assert volume.speed.shape == (NODES, NODES, 2)
    assert volume.spacing_m[2] == pytest.approx(0.004)
    assert np.array_equal(volume.speed[..., 0], reconstruct(scan, plan(sweeps=1)).speed)
    assert [(s.slice, s.sweep) for s in volume.history] == [(0, 1), (1, 1)]


def test_absolute_times_are_the_same_scan(scan):
    absolute = replace(scan, delta_tof_s=None, tof_s=scan.delta_tof_s + scan.distance_m() / WATER)
    a, b = reconstruct(scan, plan(sweeps=1)), reconstruct(absolute, plan(sweeps=1))
    assert np.allclose(a.speed, b.speed, atol=1e-6)


def test_progress_rises_to_the_end(scan):
    seen = []
    reconstruct(scan, plan(sweeps=2), seen.append)
    done = [p.done for p in seen]
    assert done == sorted(done)
    assert done[-1] == seen[-1].total == 2 * RING.elements


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"side_m": 0.1}, "side_m"),
        ({"eikonal": "magic"}, "eikonal"),
        ({"rays": "wavy"}, "rays"),
        ({"relaxation": 2.0}, "relaxation"),
        ({"relaxation": float("nan")}, "relaxation"),
        ({"nodes": 4}, "nodes"),
        ({"sweeps": 0}, "sweeps"),
        ({"speed_update": "data-driven"}, "speed_range_mps"),
        ({"speed_bounds_mps": (1600.0, 1500.0)}, "speed_bounds_mps"),
        ({"speed_bounds_mps": (1e-300, 1e300)}, "speed_bounds_mps"),
        ({"speed_bounds_mps": (1400.0, 1800.0)}, "speed_bounds_mps"),
        ({"speed_range_mps": (1400.0, float("inf"))}, "speed_range_mps"),
        ({"side_m": 20.0}, "geometry/element_position_m"),
        ({"seed": -1}, "seed"),
        ({"picker": "eye"}, "picker"),
    ],
)
def test_bad_settings_are_named(scan, change, field):
    with pytest.raises(InvalidInput) as refusal:
        reconstruct(scan, Settings(**{"nodes": NODES, **change}))
    assert refusal.value.field == field


def test_scan_without_one_valid_pair_is_refused(scan):
    with pytest.raises(InvalidInput, match="at least one finite travel time"):
        reconstruct(replace(scan, valid=np.zeros(scan.delta_tof_s.shape, bool)), plan())


def test_the_slice_without_a_valid_pair_is_named(scan):
    times = np.stack([scan.delta_tof_s, np.full_like(scan.delta_tof_s, np.nan)])
    stacked = replace(scan, delta_tof_s=times, slice_z_m=np.array([0.0, 0.004]))
    with pytest.raises(InvalidInput, match="slice 1"):
        reconstruct(stacked, plan())


@pytest.mark.parametrize(
    "position",
    [
        np.zeros((RING.elements, 2)),
        np.column_stack((np.linspace(-0.05, 0.05, RING.elements), np.zeros(RING.elements))),
        np.column_stack((RING.positions(), np.zeros(RING.elements))),
    ],
    ids=["one point", "a line", "three coordinates"],
)
def test_an_array_that_surrounds_no_image_is_refused(scan, position):
    with pytest.raises(InvalidInput) as refusal:
        reconstruct(replace(scan, element_position_m=position), Settings(nodes=32))
    assert refusal.value.field == "geometry/element_position_m"

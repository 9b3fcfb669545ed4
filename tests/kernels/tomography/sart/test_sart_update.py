"""SART: cuts change no bit, each pass has its order, speeds are stretched as published, options do."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import Problem, Settings, reconstruct, rmse
from bentray_kernels.tomography.grid_schedule import initial_slowness
from bentray_kernels.tomography.sart.sart_step import advance, begin, emitter_order
from bentray_kernels.tomography.sart.sart_update import propagation_speed, update_for

from ....table6 import table6_scan
from ...straight_scans import ring_scan

NODES, WATER = 64, 1375.0
PHANTOM = table6(WATER)
RING = Ring(64, 0.09)


@pytest.fixture(scope="module")
def scan():
    return table6_scan(RING.elements, NODES)


def plan(**changes):
    return Settings.from_values(
        **{"method": "sart", "nodes": NODES, "side_m": TABLE6_SIDE_M, "iterations": 2, **changes}
    )


@pytest.mark.parametrize("eikonal", [{}, {"eikonal": "accurate"}], ids=["compiled", "traced"])
@pytest.mark.parametrize(("wrong_s", "end"), [(-1e-3, 1), (1e-3, 0)], ids=["too early", "too late"])
def test_impossible_times_move_the_image_to_its_bounds_and_no_further(scan, eikonal, wrong_s, end):
    wanted = plan(speed_bounds_mps=(1300.0, 1600.0), relaxation=1.0, **eikonal)
    problem = Problem.from_dataset(replace(scan, delta_tof_s=scan.delta_tof_s + wrong_s), wanted)
    slowness, coverage = initial_slowness(problem, None), np.zeros(problem.region.shape)
    before = slowness.copy()
    update_for(problem, wanted)(slowness, coverage, np.arange(8), 0)
    passed = problem.region & (coverage > 0.0)
    assert passed.sum() > 0.3 * problem.region.sum()
    assert np.allclose(1.0 / slowness[passed], (1300.0, 1600.0)[end], rtol=1e-12)
    assert np.array_equal(slowness[~problem.region], before[~problem.region])


def test_data_driven_update_stretches_the_range():
    region = np.ones((4, 4), bool)
    region[0] = False
    slowness = 1.0 / np.linspace(1480.0, 1520.0, 16).reshape(4, 4)
    wanted = Settings.from_values(method="sart", speed_range_mps=(1375.0, 1560.0))
    stretched = propagation_speed(slowness, region, wanted, warm=True)
    assert stretched[region].min() == pytest.approx(1375.0)
    assert stretched[region].max() == pytest.approx(1560.0)
    assert np.allclose(stretched[0], 1.0 / slowness[0])
    assert np.allclose(propagation_speed(slowness, region, wanted, warm=False), 1.0 / slowness)
    flat = np.full((4, 4), 1 / 1500.0)
    assert np.allclose(propagation_speed(flat, region, wanted, warm=True), 1500.0)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"subset": 4, "relaxation": 0.4},
        {"speed_range_mps": (1375.0, 1560.0)},
        {"smoothing_nodes": 1.5},
    ],
    ids=lambda changes: "-".join(changes) or "plain",
)
def test_the_compiled_pass_gives_the_images_of_the_traced_one(scan, changes):
    fast = reconstruct(scan, plan(**changes))
    slow = reconstruct(scan, plan(eikonal="accurate", **changes))
    inside = PHANTOM.inside(NODES, TABLE6_SIDE_M)
    spread = float(np.std(slow.speed[inside]))
    assert np.abs(fast.speed - slow.speed)[inside].mean() < 0.03 * spread
    assert fast.residual_rms_s == pytest.approx(slow.residual_rms_s, rel=0.05)
    assert fast.coverage.sum() == pytest.approx(slow.coverage.sum(), rel=1e-2)
    assert fast.residuals.sum() == slow.residuals.sum()
    assert [sweep.emitters for sweep in fast.history] == [sweep.emitters for sweep in slow.history]


def test_a_subset_is_one_update(scan):
    """With all emitters in one subset, nothing of the first hides from the last: seeds give the same."""
    first, other = (reconstruct(scan, plan(subset=64, seed=seed, iterations=1)).speed for seed in (0, 1))
    assert np.allclose(first, other, atol=1e-2)
    alone = [reconstruct(scan, plan(seed=seed, iterations=1)).speed for seed in (0, 1)]
    assert np.abs(alone[0] - alone[1]).max() > 0.5


def test_huber_makes_wrong_picks_count_less(scan):
    truth, inside = PHANTOM.speed(NODES, TABLE6_SIDE_M), PHANTOM.inside(NODES, TABLE6_SIDE_M)
    random = np.random.default_rng(5)
    wrong = random.random(scan.delta_tof_s.shape) < 0.05
    spoiled = np.where(wrong, scan.delta_tof_s + random.normal(0.0, 4e-6, wrong.shape), scan.delta_tof_s)
    bad = replace(scan, delta_tof_s=spoiled)
    gauss_newton = plan(method="gauss-newton", iterations=4)
    plain, robust = (
        rmse(reconstruct(bad, gauss_newton.changed(huber_scale=spreads)).speed, truth, inside)
        for spreads in (0.0, 3.0)
    )
    assert robust < 0.9 * plain


@given(cuts=st.lists(st.integers(1, 40), min_size=1, max_size=8), subset=st.sampled_from([1, 5]))
@settings(max_examples=8, deadline=None)
def test_cutting_the_work_changes_no_bit(cuts, subset):
    dataset = ring_scan(16, 0.08, np.random.default_rng(0).normal(0.0, 2e-7, (16, 16)), WATER)
    wanted = Settings.from_values(method="sart", nodes=24, iterations=2, subset=subset)
    problem = Problem.from_dataset(dataset, wanted)
    start = begin(initial_slowness(problem, None))
    whole, cut, before = start, start, start.slowness.copy()
    while not whole.done:
        whole = advance(problem, wanted, whole, 10**6)
    for most in itertools.cycle(cuts):
        cut = advance(problem, wanted, cut, most)
        if cut.done:
            break
    for name in ("slowness", "coverage", "residuals"):
        assert np.array_equal(getattr(whole, name), getattr(cut, name)), name
    assert whole.history == cut.history
    assert np.array_equal(start.slowness, before)


def test_every_pass_slice_and_seed_has_an_order_of_its_own(scan):
    problem = Problem.from_dataset(scan, plan())
    orders = [emitter_order(problem, *which) for which in ((0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0))]
    assert len({tuple(order) for order in orders}) == 4
    assert all(sorted(order) == list(range(RING.elements)) for order in orders)

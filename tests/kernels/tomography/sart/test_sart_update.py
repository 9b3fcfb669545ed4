"""Updates of an image: speeds are stretched as published, the compiled pass is the traced one, options do."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import Problem, Settings, reconstruct, rmse
from bentray_kernels.tomography.grid_schedule import initial_slowness
from bentray_kernels.tomography.sart.sart_step import advance, begin
from bentray_kernels.tomography.sart.sart_update import propagation_speed, update_for

from ....table6 import table6_scan

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


@pytest.mark.parametrize("changes", [{"cut": 3}, {"cut": 7, "subset": 5}], ids=["one", "subsets"])
def test_cuts_of_the_compiled_pass_change_no_bit(scan, changes):

    wanted = plan(subset=changes.get("subset", 1))
    problem = Problem.from_dataset(scan, wanted)
    whole = cut = begin(initial_slowness(problem, None))
    before = whole.slowness.copy()
    while not whole.done:
        whole = advance(problem, wanted, whole, 10**6)
    while not cut.done:
        cut = advance(problem, wanted, cut, changes["cut"])
    for name in ("slowness", "coverage", "residuals"):
        assert np.array_equal(getattr(whole, name), getattr(cut, name)), name
    assert whole.history == cut.history
    assert np.array_equal(before, begin(initial_slowness(problem, None)).slowness)


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

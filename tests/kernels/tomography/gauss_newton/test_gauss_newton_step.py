"""Gauss–Newton: each pair once, an end that is never worse than the best image, and Huber's loss."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, Ellipse, EllipsePhantom, table6
from bentray_kernels.tomography import Problem, Settings, reconstruct, rmse
from bentray_kernels.tomography.gauss_newton import gauss_newton_step, huber
from bentray_kernels.tomography.gauss_newton.linearisation import Rows
from bentray_kernels.tomography.grid_schedule import initial_slowness

from ....table6 import table6_scan

WATER = 1500.0
PLAN = Settings(method="gauss-newton", nodes=24, iterations=9)


def problem(delta, tx=None, rx=None):
    count = len(delta)
    tx = np.arange(count) if tx is None else tx
    rx = np.arange(count) if rx is None else rx
    ring = Ring(max(tx.max(), rx.max()) + 1, 0.08)
    dataset = Dataset(ring.positions(), tx, rx, WATER, delta_tof_s=delta)
    return Problem.from_dataset(dataset, PLAN.changed(reciprocity=False))


def test_each_pair_is_kept_once():
    rng = np.random.default_rng(1)
    for count in (7, 8):
        delta = rng.normal(size=(count, count))
        delta[2, 5], delta[1, 3], delta[3, 1] = np.nan, np.nan, np.nan
        np.fill_diagonal(delta, np.nan)
        once = problem(delta).each_pair_once().delta_tof
        kept = np.isfinite(once)
        assert not (kept & kept.T).any()
        whole = np.where(kept, once, once.T)
        assert np.allclose(whole[0, 1], 0.5 * (delta[0, 1] + delta[1, 0]))
        assert whole[2, 5] == delta[5, 2]
        assert np.isnan(whole[1, 3])
        assert kept.sum() == count * (count - 1) // 2 - 1
        # No emitter has much more to do than another.
        assert np.ptp(kept.sum(axis=1)) <= 2


def test_emitters_that_do_not_receive_keep_all_pairs():
    delta = np.random.default_rng(2).normal(size=(4, 4))
    apart = problem(delta, tx=np.arange(4), rx=np.arange(4, 8))
    assert np.array_equal(apart.each_pair_once().delta_tof, delta)


def rows(residual):
    """One ray through one node."""
    return Rows(
        np.array([0, 1]),
        np.array([300], np.int32),
        np.ones(1, np.float32),
        np.array([residual]),
        np.array([1]),
    )


@pytest.fixture(scope="module")
def of():
    return problem(np.zeros((8, 8)))


def states_after(of, misfits, **changes):
    """The first state, and those after passes with these misfits; all but the last are not done."""
    states = [gauss_newton_step.begin(initial_slowness(of, None))]
    for misfit in misfits:
        assert not states[-1].done
        states.append(gauss_newton_step.step(of, replace(PLAN, **changes), states[-1], [rows(misfit)]))
    return states


def test_step_that_increases_the_misfit_is_halved_then_rejected(of):
    misfits = [4e-7, 2e-7, 6e-7, 5e-7, 4e-7, 3e-7]
    states = states_after(of, misfits)
    assert states[-1].done
    # The misfit of 2e-7 was measured on what the first step gave.
    best, far = states[1].slowness, states[2].slowness
    assert np.array_equal(states[-1].slowness, best)
    assert np.allclose(states[3].slowness - best, 0.5 * (far - best))
    assert np.allclose(states[5].slowness - best, 0.125 * (far - best))
    assert [sweep.residual_rms_s for sweep in states[-1].history] == misfits


def test_continues_after_a_successful_halved_step(of):
    state = states_after(of, (4e-7, 2e-7, 6e-7, 1e-7))[-1]
    assert not state.done
    assert state.halvings == 0
    assert state.best.loss == pytest.approx(1e-7)


def test_the_last_pass_measures_and_the_best_image_is_given(of):
    states = states_after(of, (4e-7, 2e-7, 1e-7), iterations=3)
    assert states[-1].done
    assert np.array_equal(states[-1].slowness, states[2].slowness)
    # Which one is known at the end.
    assert [sweep.given for sweep in states[2].history] == [False, False]
    assert [sweep.given for sweep in states[-1].history] == [False, False, True]
    assert states[-1].best.loss == pytest.approx(1e-7)
    start, once = states_after(of, [4e-7], iterations=1)
    assert once.done
    assert not np.array_equal(once.slowness, start.slowness)


@pytest.mark.parametrize(("misfit", "given"), [(2.03e-7, 3), (2.05e-7, 2)])
def test_of_images_that_miss_alike_the_last_is_given(of, misfit, given):
    *_, before, state = states_after(of, (4e-7, 2e-7, misfit), iterations=3)
    assert [sweep.sweep for sweep in state.history if sweep.given] == [given]
    assert np.array_equal(state.slowness, before.slowness) == (given == 3)


def test_no_ray_through_the_image_leaves_water(of):
    outside = replace(rows(1e-7), columns=np.array([0], np.int32))
    state = gauss_newton_step.step(of, PLAN, gauss_newton_step.begin(initial_slowness(of, None)), [outside])
    assert np.allclose(state.slowness, 1.0 / WATER)


def test_stops_without_improvement(of):
    assert states_after(of, (4e-7, 2e-7, 1.99e-7, 1.98e-7))[-1].done


def test_one_image_without_improvement_does_not_stop_the_search(of):
    """Bent rays did so on waves of 1 MHz: far less was missed after an image that missed as much."""
    # One that grows is halved, and counts for nothing.
    states = states_after(of, (4e-7, 2e-7, 1.99e-7, 2.1e-7, 1.5e-7, 1.49e-7, 1.48e-7))
    assert [state.idle for state in states[1:-1]] == [0, 0, 1, 1, 0, 1]
    assert states[-1].done
    assert [sweep.sweep for sweep in states[-1].history if sweep.given] == [7]


def test_flat_parts_come_back_sharper_when_edges_are_cheap():
    side, phantom, scan = TABLE6_SIDE_M, table6(1375.0), table6_scan(48, 48)
    truth, inside = phantom.speed(48, side), phantom.inside(48, side)
    plan = replace(PLAN, nodes=48, side_m=side, iterations=8)
    plain, sharp = (
        rmse(reconstruct(scan, plan.changed(edge_mps=edge)).speed, truth, inside) for edge in (0.0, 7.0)
    )
    assert sharp < 0.9 * plain


@pytest.mark.parametrize(("penalty", "scale"), [("laplacian", 1.0), ("total-variation", 3e-7)])
def test_quadratic_penalties_are_relative_to_the_data_and_the_total_variation_to_the_misfit(
    monkeypatch, of, penalty, scale
):
    strengths = []

    class Recorded(gauss_newton_step.Linearised):
        def __init__(self, *values):
            strengths.append(values[5])
            super().__init__(*values)

    monkeypatch.setattr(gauss_newton_step, "Linearised", Recorded)
    plan = PLAN.changed(penalty=penalty, penalty_strength=0.25)
    gauss_newton_step.step(of, plan, gauss_newton_step.begin(initial_slowness(of, None)), [rows(3e-7)])
    assert strengths == [pytest.approx(0.25 * scale)]


def test_far_residuals_move_the_limit_as_little_as_they_add_to_the_loss():
    residual = np.array([*np.linspace(-2e-8, 2e-8, 99), 5e-6])
    limit = huber.limit(residual, 3.0)
    assert limit == pytest.approx(3.0 * np.median(np.abs(residual)) / 0.6745)
    assert huber.limit(residual, 0.0) == np.inf
    assert huber.loss(residual, np.inf) == pytest.approx(np.sqrt((residual**2).mean()))
    assert huber.loss(residual, limit) < 0.2 * huber.loss(residual, np.inf)
    assert huber.clipped_rms(residual, limit) < huber.loss(residual, limit)


@given(st.floats(1e-9, 1e-6), st.floats(1e-9, 1e-6))
def test_the_loss_is_that_of_huber(size, limit):
    loss = 0.5 * size**2 if size <= limit else limit * (size - 0.5 * limit)
    assert huber.loss(np.array([size, -size]), limit) == pytest.approx(np.sqrt(2.0 * loss))


@given(st.integers(1, 49), st.floats(0.0, 1e-11))
def test_a_minority_that_alone_misses_is_not_taken_for_outliers(few, rest):
    residual = np.full(100, rest)
    residual[:few] = 3e-7
    assert huber.limit(residual, 3.0) == pytest.approx(max(0.7 * residual.mean(), 3.0 * rest / 0.6745))


def test_residuals_that_are_all_zero_have_no_limit():
    assert huber.limit(np.zeros(5), 3.0) == np.inf


def test_a_small_object_in_exact_times_is_found():
    disc = EllipsePhantom(WATER, (Ellipse((0.02, 0.01), (0.012, 0.01), 1560.0, 0.0, "disc"),))
    ring, emitters = Ring(32, 0.09), np.arange(32)
    delta = TravelTimeScan(disc, ring, TABLE6_SIDE_M, nodes=32).delta_tof(emitters)
    delta[np.abs(delta) < 1e-12] = 0.0
    assert np.median(np.abs(delta)) == 0.0
    dataset = Dataset(ring.positions(), emitters, emitters, WATER, delta_tof_s=delta)
    plan = Settings(method="gauss-newton", nodes=32, side_m=TABLE6_SIDE_M, iterations=6)
    truth, inside = disc.speed(32, TABLE6_SIDE_M), disc.inside(32, TABLE6_SIDE_M)
    robust, plain = (
        rmse(reconstruct(dataset, plan.changed(huber_scale=spreads)).speed, truth, inside)
        for spreads in (3.0, 0.0)
    )
    assert robust < 3.0 * plain < 15.0

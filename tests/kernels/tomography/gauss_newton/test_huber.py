"""Huber's loss: its value, and the limit that the residuals' own spread gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import TABLE6_SIDE_M, Ellipse, EllipsePhantom
from bentray_kernels.tomography import Settings, reconstruct, rmse
from bentray_kernels.tomography.gauss_newton import huber

WATER_MPS = 1500.0


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
    disc = EllipsePhantom(WATER_MPS, (Ellipse((0.02, 0.01), (0.012, 0.01), 1560.0, 0.0, "disc"),))
    ring, emitters = Ring(32, 0.09), np.arange(32)
    delta = TravelTimeScan(disc, ring, TABLE6_SIDE_M, nodes=32).delta_tof(emitters)
    delta[np.abs(delta) < 1e-12] = 0.0
    assert np.median(np.abs(delta)) == 0.0
    dataset = Dataset(ring.positions(), emitters, emitters, WATER_MPS, delta_tof_s=delta)
    plan = Settings(method="gauss-newton", nodes=32, side_m=TABLE6_SIDE_M, iterations=6)
    truth, inside = disc.speed(32, TABLE6_SIDE_M), disc.inside(32, TABLE6_SIDE_M)
    robust, plain = (
        rmse(reconstruct(dataset, plan.changed(huber_scale=spreads)).speed, truth, inside)
        for spreads in (3.0, 0.0)
    )
    assert robust < 3.0 * plain < 15.0

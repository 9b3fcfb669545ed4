"""One emitter's SART contribution: zero for exact data, equation 1, the Gaussian of SciPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from bentray_kernels.rays import sensitivities
from bentray_kernels.tomography.sart.emitter_pass import EmitterPass, gaussian

SHAPE, SPACING, WATER = (48, 40), 2e-3, 1480.0
BOUNDS = (1.0 / 1800.0, 1.0 / 1300.0)
SOURCE = np.array([3.4, 18.2]) * SPACING
RECEIVERS = np.array([[44.0, float(k)] for k in range(3, 37, 2)]) * SPACING
REGION = np.zeros(SHAPE, bool)
REGION[8:40, 5:35] = True


def image():
    x, y = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in SHAPE), indexing="ij")
    return (1.0 + 0.05 * np.exp(-(x**2 + y**2) / 0.1)) / WATER


def moved(work, slowness, smoothing, relaxation=0.5):
    after, coverage = slowness.copy(), np.zeros(SHAPE)
    work.update(after, coverage, REGION, SPACING, relaxation, smoothing, BOUNDS)
    return after, coverage


def test_zero_residual_gives_no_update():
    work = EmitterPass.for_grid(SHAPE, len(RECEIVERS))
    slowness = image()
    nothing = np.zeros(len(RECEIVERS))
    predicted = -work.trace(slowness, slowness, SPACING, SOURCE, RECEIVERS, nothing)
    moved(work, slowness, 1.0)
    left = work.trace(slowness, slowness, SPACING, SOURCE, RECEIVERS, predicted)
    assert np.abs(left).max() < 1e-12
    after, coverage = moved(work, slowness, 1.0)
    assert np.allclose(after, slowness, rtol=1e-7)
    assert coverage.sum() == pytest.approx(np.linalg.norm(RECEIVERS - SOURCE, axis=1).sum(), rel=1e-3)


def test_straight_rays_and_their_update_are_equation_1():
    slowness = image()
    rows = sensitivities(slowness, SPACING, RECEIVERS, SOURCE, kind="straight")
    measured = rows @ slowness.ravel() + 1e-7 * np.sin(np.arange(len(RECEIVERS)))
    work = EmitterPass.for_grid(SHAPE, len(RECEIVERS))
    left = work.trace(slowness, None, SPACING, SOURCE, RECEIVERS, measured)
    truth = measured - rows @ slowness.ravel()
    # Two parts of a node are read there, one and a half nodes at once here.
    assert np.allclose(left, truth, atol=1e-9)
    after, coverage = moved(work, slowness, 0.0)
    weights = rows.sum(axis=0)
    wanted = rows.T @ (truth / rows.sum(axis=1)) / np.where(weights > 0.0, weights, 1.0)
    change = gaussian_filter((after - slowness) / 0.5, 2.0)
    wanted = gaussian_filter(np.where(REGION, wanted.reshape(SHAPE), 0.0), 2.0)
    assert np.abs(change - wanted).mean() < 0.08 * np.abs(wanted).mean()
    assert (after[~REGION] == slowness[~REGION]).all()
    assert coverage.sum() == pytest.approx(rows.sum(), rel=1e-3)


def test_contributions_accumulate_until_the_update():
    slowness = image()
    work = EmitterPass.for_grid(SHAPE, len(RECEIVERS))
    for half in (slice(None, 8), slice(8, None)):
        work.trace(slowness, slowness, SPACING, SOURCE, RECEIVERS[half], np.full(len(RECEIVERS[half]), 6e-5))
    twice = moved(work, slowness, 1.0)
    work.trace(slowness, slowness, SPACING, SOURCE, RECEIVERS, np.full(len(RECEIVERS), 6e-5))
    once = moved(work, slowness, 1.0)
    assert np.allclose(twice[0], once[0], rtol=1e-6)
    assert np.allclose(twice[1], once[1], rtol=1e-4, atol=1e-7)


@given(seed=st.integers(0, 99), smoothing=st.sampled_from([0.4, 1.0, 2.5, 20.0]))
@settings(max_examples=10, deadline=None)
def test_the_gaussian_is_that_of_scipy(seed, smoothing):
    work = EmitterPass.for_grid(SHAPE, 1)
    change = np.random.default_rng(seed).uniform(-1e-6, 1e-6, SHAPE)
    slowness = np.full(SHAPE, 1.0 / WATER)
    work.sums[0::2], work.sums[1::2] = change.ravel() * SPACING, 1.0
    after, coverage = moved(work, slowness, smoothing, 1.0)
    wanted = gaussian_filter(np.where(REGION, change, 0.0), smoothing, mode="nearest")
    assert np.allclose((after - slowness)[REGION], wanted[REGION], rtol=1e-4, atol=1e-11)
    assert np.allclose(coverage, SPACING)
    assert not work.sums.any()


def test_bounds_hold_and_weights_sum_to_one():
    work = EmitterPass.for_grid(SHAPE, 1)
    work.sums[0::2], work.sums[1::2] = 1.0, 1.0
    after, _ = moved(work, image(), 1.0)
    assert after[REGION].min() == after[REGION].max() == BOUNDS[1]
    work.sums[0::2], work.sums[1::2] = -1.0, 1.0
    after, _ = moved(work, image(), 1.0)
    assert after[REGION].min() == after[REGION].max() == BOUNDS[0]
    assert gaussian(0.0).tolist() == [1.0]
    assert 2.0 * gaussian(1.7).sum() - gaussian(1.7)[0] == pytest.approx(1.0)

"""The deviation of a front: none in water, that of the accurate solver in tissue, never nonsense."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from bentray_kernels.eikonal import solve
from bentray_kernels.eikonal.deviation import allocate_sweep_arrays, deviate
from bentray_kernels.eikonal.problem import PointSource

from ...effort import effort

SPACING, WATER = 1e-3, 1480.0
SHAPES = st.tuples(st.integers(2, 40), st.integers(2, 40))
PARTS = st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0))


def factored_sweeping(problem):
    """Travel time by the deviation, (nx, ny), s."""
    slowness, at_source = problem.slowness, problem.source_slowness()
    into = np.empty(slowness.size, np.float32)
    j, k = problem.source / problem.spacing
    deviate(
        (slowness / at_source).astype(np.float32).ravel(), j, k, allocate_sweep_arrays(slowness.shape), into
    )
    x, y = (np.arange(n) for n in slowness.shape)
    distance = np.hypot(x[:, None] - j, y[None, :] - k)
    return (distance + into.reshape(slowness.shape)) * at_source * problem.spacing


def place(shape, part):
    return np.array(part) * (np.array(shape) - 1) * SPACING


def distances(shape, source):
    x, y = (np.arange(n) * SPACING for n in shape)
    return np.hypot(x[:, None] - source[0], y[None, :] - source[1])


def tissue(seed, shape=(70, 60), size=0.08):
    """Smooth lumps, up to ``size`` faster or slower than water, away from the rim."""
    lumps = gaussian_filter(np.random.default_rng(seed).normal(size=shape), 4.0)
    rim = np.minimum.outer(*(np.minimum(np.arange(n), np.arange(n)[::-1]) for n in shape))
    lumps *= np.clip((rim - 6) / 6, 0.0, 1.0)
    return WATER * (1.0 + size * lumps / np.abs(lumps).max())


@given(shape=SHAPES, part=PARTS)
def test_water_is_crossed_along_straight_lines(shape, part):
    source = place(shape, part)
    tof = factored_sweeping(PointSource.checked(np.full(shape, WATER), SPACING, source))
    off = np.abs(tof * WATER - distances(shape, source)) / SPACING
    # Beside an axis through the source, nodes on either side wait for each other.
    assert off.max() < 2e-2
    assert off.mean() < 2e-3


@given(seed=st.integers(0, 2**32 - 1), part=st.floats(0.0, 1.0))
@settings(max_examples=8, deadline=None)
def test_as_accurate_as_the_accurate_solver_in_tissue(seed, part):
    speed = tissue(seed)
    source = place(speed.shape, (part, 0.02))
    truth = solve(speed, SPACING, source, supersample=4)
    crossing = SPACING / WATER
    times = factored_sweeping(PointSource.checked(speed, SPACING, source))
    error, accurate, plain = (
        np.abs(tof - truth).mean() / crossing
        for tof in (times, solve(speed, SPACING, source), solve(speed, SPACING, source, "fsm"))
    )
    assert error < 2.0 * accurate + 2e-3
    assert error < 0.05 * plain


@given(part=st.tuples(st.floats(0.2, 0.8), st.floats(0.2, 0.8)), slope=st.floats(0.01, 0.03))
def test_exact_in_a_constant_gradient_around_the_source(part, slope):
    """The times of the first nodes decide about all later ones; the exact time is known."""
    shape = (41, 41)
    speed = WATER * (1.0 + slope * np.arange(41.0))[:, None] * np.ones(41)
    source = place(shape, part)
    at_source, per_metre = WATER * (1.0 + slope * source[0] / SPACING), WATER * slope / SPACING
    squared = distances(shape, source) ** 2
    exact = np.arccosh(1.0 + 0.5 * per_metre**2 * squared / (at_source * speed)) / per_metre
    error = (factored_sweeping(PointSource.checked(speed, SPACING, source)) - exact) * at_source / SPACING
    near = squared < (3.0 * SPACING) ** 2
    assert np.abs(error[near]).max() < 0.05 * slope + 5e-4
    assert np.abs(error).mean() < 0.27 * slope


@given(seed=st.integers(0, 2**32 - 1), shape=SHAPES, part=PARTS)
@settings(max_examples=effort(20, 40), deadline=None)
def test_rough_media_give_times_that_can_be(seed, shape, part):
    speed = WATER * np.random.default_rng(seed).uniform(0.5, 2.0, shape)
    source = place(shape, part)
    tof = factored_sweeping(PointSource.checked(speed, SPACING, source))
    assert np.isfinite(tof).all()
    plain = solve(speed, SPACING, source, "fsm")
    far = plain > 3.0 * SPACING / speed.min()
    assert (tof[far] > 0.5 * plain[far]).all()
    assert (tof[far] < 1.5 * plain[far]).all()


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_no_direction_is_preferred(seed):
    speed = tissue(seed)
    source = place(speed.shape, (0.3, 0.05))
    extent = place(speed.shape, (1.0, 1.0))
    upright = factored_sweeping(PointSource.checked(speed, SPACING, source))
    turned = factored_sweeping(PointSource.checked(speed.T, SPACING, source[::-1])).T
    flipped = factored_sweeping(PointSource.checked(speed[::-1], SPACING, (extent[0] - source[0], source[1])))
    for other in (turned, flipped[::-1]):
        assert np.abs(upright - other).mean() < 2e-3 * SPACING / WATER


def test_used_arrays_change_no_bit():
    at = allocate_sweep_arrays((50, 40))
    results = []
    for seed in (0, 1, 0):
        slowness = (WATER / tissue(seed, (50, 40))).astype(np.float32).ravel()
        into = np.empty(slowness.size, np.float32)
        deviate(slowness, 3.2 + seed, 20.7, at, into)
        results.append(into)
    assert np.array_equal(results[0], results[2])
    assert not np.array_equal(results[0], results[1])

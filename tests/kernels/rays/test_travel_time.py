"""Travel times along bent rays: stationary, more accurate than the grid, and never later than the ray."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal, rays
from bentray_kernels.errors import InvalidInput

from ...effort import effort
from .problems import gradient_speed, gradient_times, rough_problem


def gradient_problem(n, ndim, receivers):
    """Speed 1 + 4x on the unit cube, and the exact times from one point of it to some others."""
    source = np.array([0.2, 0.13, 0.4])[:ndim]
    return gradient_speed(n, ndim), 1.0 / (n - 1), source, gradient_times(receivers, source)


@pytest.mark.parametrize(("ndim", "sizes"), [(2, (33, 65, 129)), (3, (17, 33))])
def test_far_more_accurate_than_the_grid_and_of_higher_order(ndim, sizes):
    receivers = np.random.default_rng(2).uniform(0.15, 0.85, (40, ndim))
    errors, grids = [], []
    for n in sizes:
        speed, spacing, source, exact = gradient_problem(n, ndim, receivers)
        tof = eikonal.solve(speed, spacing, source)
        errors.append(np.abs(rays.travel_times(tof, speed, spacing, receivers, source) - exact).max())
        matrix = rays.sensitivities(tof, spacing, receivers, source)
        grids.append(np.abs(matrix @ (1.0 / speed).ravel() - exact).max())
    assert errors[-1] < 0.02 * grids[-1]
    assert np.log2(errors[0] / errors[-1]) / (len(sizes) - 1) > 2.3


def test_the_rim_costs_accuracy_but_no_more_than_the_grid_has():
    """The spline is mirrored at the rim, where the medium is not."""
    receivers = np.random.default_rng(2).uniform(0.0, 1.0, (40, 2))
    speed, spacing, source, exact = gradient_problem(129, 2, receivers)
    tof = eikonal.solve(speed, spacing, source)
    assert np.abs(rays.travel_times(tof, speed, spacing, receivers, source) - exact).max() < 2e-6


@pytest.mark.parametrize("ndim", [2, 3])
def test_exact_in_a_homogeneous_medium(ndim):
    rng = np.random.default_rng(3)
    source, receivers = rng.uniform(0.0, 1.1, ndim), rng.uniform(0.0, 1.1, (30, ndim))
    speed = np.full((12,) * ndim, 1500.0)
    tof = eikonal.solve(speed, 0.1, source)
    times = rays.travel_times(tof, speed, 0.1, receivers, source)
    assert np.allclose(times, np.linalg.norm(receivers - source, axis=1) / 1500.0, rtol=1e-9, atol=1e-12)


@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans())
@settings(max_examples=effort(20, 40), deadline=None)
def test_rough_models_give_times_that_no_straight_ray_undercuts(seed, flat):
    """Fermat: bending begins at a ray and only takes time off it, even where no valley is smooth."""
    speed, source, receivers = rough_problem(seed, flat, 0.5, 2.0)
    tof = eikonal.solve(speed, 1.0, source)
    times = rays.travel_times(tof, speed, 1.0, receivers, source)
    distance = np.linalg.norm(receivers - source, axis=1)
    assert np.isfinite(times).all()
    # Splines overshoot the nodes' speeds a little.
    assert (times >= 0.5 * distance / speed.max()).all()
    assert (
        times <= 1.5 * rays.sensitivities(tof, 1.0, receivers, source) @ (1.0 / speed).ravel() + 1e-9
    ).all()


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_a_poor_guide_leads_to_the_same_ray(seed):
    """The medium alone decides: times guided by first-order wave fronts equal those guided by the best."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 60), np.linspace(0.0, 1.0, 60), indexing="ij")
    angle = rng.uniform(0.0, 2.0 * np.pi)
    speed = 1500.0 + 90.0 * np.sin(3.0 * (np.cos(angle) * x + np.sin(angle) * y) + angle)
    receivers = rng.uniform(0.0, 0.59, (10, 2))
    guided = [
        rays.travel_times(eikonal.solve(speed, 0.01, (0.05, 0.3), m), speed, 0.01, receivers, (0.05, 0.3))
        for m in ("accurate", "fsm")
    ]
    assert np.allclose(*guided, rtol=3e-6, atol=1e-12)


@pytest.mark.parametrize("flat", [True, False])
def test_blocks_of_twice_the_speed_leave_no_ray_behind(flat):
    """Random blocks, as hard as bending can take: no time is far from that of the grid."""
    rng = np.random.default_rng(4)
    shape = (40, 40) if flat else (18, 18, 18)
    last = np.array(shape) - 1.0
    for _ in range(6 if flat else 3):
        speed = rng.choice([1500.0, 3000.0], shape)
        source, receivers = 0.1 * last, last * rng.uniform(0.3, 1.0, (80, len(shape)))
        tof = eikonal.solve(speed, 1.0, source)
        ratio = rays.travel_times(tof, speed, 1.0, np.rint(receivers), source)
        ratio /= tof[tuple(np.rint(receivers).astype(int).T)]
        assert ratio.min() > 0.7
        assert ratio.max() < 1.1


def test_reciprocal_to_the_tolerance():
    x = np.linspace(0.0, 1.0, 80)
    speed = 1500.0 + 60.0 * np.exp(-((x[:, None] - 0.5) ** 2 + (x[None, :] - 0.45) ** 2) / 0.02)
    a, b = np.array([0.05, 0.2]), np.array([0.72, 0.6])
    there = rays.travel_times(eikonal.solve(speed, 0.01, a), speed, 0.01, [b], a)[0]
    back = rays.travel_times(eikonal.solve(speed, 0.01, b), speed, 0.01, [a], b)[0]
    assert abs(there / back - 1.0) < 1e-6


def test_receiver_on_the_source_takes_no_time():
    speed = np.ones((8, 8))
    tof = eikonal.solve(speed, 1.0, (3.0, 3.0))
    assert rays.travel_times(tof, speed, 1.0, [[3.0, 3.0]], (3.0, 3.0))[0] == 0.0


@pytest.mark.parametrize(
    ("speed", "words"),
    [
        (np.ones((8, 9)), "shape"),
        (np.where(np.eye(8) > 0, 1.0, np.nan), "node (0, 1)"),
        (np.zeros((8, 8)), "0"),
    ],
)
def test_bad_speeds_are_named(speed, words):
    tof = eikonal.solve(np.ones((8, 8)), 1.0, (3.0, 3.0))
    with pytest.raises(InvalidInput) as refusal:
        rays.travel_times(tof, speed, 1.0, [[3.0, 5.0]], (3.0, 3.0))
    assert refusal.value.field == "speed"
    assert words in str(refusal.value)

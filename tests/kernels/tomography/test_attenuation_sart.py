"""SART of the attenuation: equation 1 by hand, the true image stays, bounds and region hold."""

import numpy as np
import pytest

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.attenuation_sart import solve

from .gauss_newton.test_linear_problem import rows_of

SHAPE, BOUNDS = (6, 5), (0.0, 9.0)
EVERYWHERE = np.ones(SHAPE, bool)


def plan(**changes):
    return Settings.from_values(method="sart", smoothing_nodes=0.0, **changes)


def crossing(rays, seed=0):
    """Random rays, each through a third of the nodes."""
    random = np.random.default_rng(seed)
    return random.random((rays, 30)) * (random.random((rays, 30)) < 0.3)


@pytest.mark.parametrize("node", [1.0, 0.02], ids=["long rays", "rays shorter than a node"])
def test_one_emitter_follows_equation_1(node):
    matrix, residual = node * crossing(4), node * np.array([1.0, 0.5, 2.0, 0.2])
    water = np.full(SHAPE, 0.3)
    solution = solve(
        [rows_of(matrix, residual, [4])], water, EVERYWHERE, plan(iterations=1, relaxation=0.5), BOUNDS
    )
    corrections, sums = residual / matrix.sum(axis=1), matrix.sum(axis=0)
    update = np.where(sums > 0.0, corrections @ matrix / np.where(sums > 0.0, sums, 1.0), 0.0)
    np.testing.assert_allclose(solution.ravel(), 0.3 + 0.5 * update, atol=1e-6)


def test_emitters_follow_each_other_in_random_order():
    matrix, residual = crossing(6), np.linspace(0.2, 1.2, 6)
    water = np.zeros(SHAPE)
    together = [rows_of(matrix, residual, [2, 4])]
    apart = [rows_of(matrix[:2], residual[:2], [2]), rows_of(matrix[2:], residual[2:], [4])]
    results = [solve(parts, water, EVERYWHERE, plan(iterations=3), BOUNDS) for parts in (together, apart)]
    np.testing.assert_array_equal(*results)
    orders = {
        solve(together, water, EVERYWHERE, plan(iterations=1, seed=k), BOUNDS).tobytes() for k in range(8)
    }
    assert len(orders) == 2


@pytest.mark.parametrize("smoothing", [0.0, 1.0])
def test_the_true_image_stays_and_is_found(smoothing):
    truth = np.random.default_rng(1).random(SHAPE) if smoothing == 0.0 else np.full(SHAPE, 0.7)
    matrix = np.float32(crossing(200, 2)).astype(float)
    parts = [rows_of(matrix, matrix @ (truth - 0.5).ravel(), [50] * 4)]
    settings = plan(iterations=400, relaxation=1.0).changed(smoothing_nodes=smoothing)
    solution = solve(parts, np.full(SHAPE, 0.5), EVERYWHERE, settings, BOUNDS)
    np.testing.assert_allclose(solution, truth, atol=2e-3)


def test_region_and_bounds_hold():
    region = np.zeros(SHAPE, bool)
    region[2:4] = True
    parts = [rows_of(crossing(20), np.full(20, -50.0), [10, 10])]
    solution = solve(parts, np.full(SHAPE, 0.4), region, plan(iterations=20), BOUNDS)
    assert (solution[~region] == 0.4).all()
    assert solution[region].min() == 0.0
    parts = [rows_of(crossing(20), np.full(20, 500.0), [0, 10, 10, 0])]
    solution = solve(parts, np.full(SHAPE, 0.4), region, plan(iterations=20), BOUNDS)
    assert solution[region].max() == 9.0

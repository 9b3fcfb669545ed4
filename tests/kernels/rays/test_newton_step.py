"""The Newton step: gradient and Hessian of the discrete travel time by differences, and its limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.rays.newton_step import MAX_SHIFT, allocate_bending, factorise, shift

SEEDS = st.integers(0, 2**32 - 1)
SIDE = 40


class Medium:
    """Slowness 1 + slope·x + ½·xᵀ·second·x, x from a point of the grid."""

    def __init__(self, rng, ndim, slope=0.0, second=0.0):
        mixed = rng.normal(size=(ndim, ndim))
        self.slope, self.second = slope * rng.normal(size=ndim), second * (mixed + mixed.T)
        self.origin = np.full(ndim, 0.5 * SIDE)

    def slowness(self, points):
        off = points - self.origin
        return 1.0 + off @ self.slope + 0.5 * np.einsum("ka,ab,kb->k", off, self.second, off)

    def time(self, path):
        lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
        values = self.slowness(path)
        return (0.5 * (values[1:] + values[:-1]) * lengths).sum()

    def work(self, path):
        """The intermediate values at a path, as bending fills them."""
        work = allocate_bending(len(path) + 3, (SIDE,) * path.shape[1])
        count, vector = len(path), np.diff(path, axis=0)
        work.slowness[:count] = values = self.slowness(path)
        work.slope[:count] = self.slope + (path - self.origin) @ self.second
        work.second[:count] = self.second
        work.vector[: count - 1] = vector
        work.length[: count - 1] = lengths = np.linalg.norm(vector, axis=1)
        work.tension[: count - 1] = 0.5 * (values[1:] + values[:-1]) / lengths
        return work


def derivatives(medium, path, work):
    """Gradient and Hessian of the time in shifts of the inner points along the normals, by differences."""
    normals = work.normal[1 : len(path) - 1]
    inner, across, _ = normals.shape

    def time(shifts):
        moved = path.copy()
        moved[1:-1] += np.einsum("ki,kia->ka", shifts.reshape(inner, across), normals)
        return medium.time(moved)

    size, h = inner * across, 1e-3
    unit = h * np.eye(size)
    gradient = np.array([time(u) - time(-u) for u in unit]) / (2.0 * h)
    hessian = np.array(
        [[time(u + v) - time(u - v) - time(v - u) + time(-u - v) for v in unit] for u in unit]
    ) / (4.0 * h * h)
    return gradient, hessian


def zigzag(rng, count, ndim, size=0.15):
    """A path along a random direction through the middle of the grid, with so large random steps aside."""
    along = rng.normal(size=ndim)
    along /= np.linalg.norm(along)
    positions = np.cumsum(rng.uniform(0.8, 1.6, count))
    points = 0.5 * SIDE + (positions - positions.mean())[:, None] * along
    return points + size * rng.normal(size=(count, ndim))


@pytest.mark.parametrize("ndim", [2, 3])
@given(seed=SEEDS)
@settings(deadline=None)
def test_normals_are_orthonormal_and_normal_to_the_path(ndim, seed):
    path = zigzag(np.random.default_rng(seed), 7, ndim, 0.4)
    work = Medium(np.random.default_rng(seed), ndim).work(path)
    factorise(len(path), (SIDE,) * ndim, False, work)
    for k in range(1, len(path) - 1):
        normals = work.normal[k]
        assert np.allclose(normals @ normals.T, np.eye(ndim - 1), atol=1e-12)
        assert np.allclose(normals @ (path[k + 1] - path[k - 1]), 0.0, atol=1e-12)


@pytest.mark.parametrize("ndim", [2, 3])
@pytest.mark.parametrize("count", [3, 4, 7])
@given(seed=SEEDS)
@settings(max_examples=10, deadline=None)
def test_the_step_of_a_homogeneous_medium_is_that_of_the_exact_hessian(ndim, count, seed):
    rng = np.random.default_rng(seed)
    medium, path = Medium(rng, ndim), zigzag(rng, count, ndim)
    work = medium.work(path)
    decrease = factorise(count, (SIDE,) * ndim, True, work)
    gradient, hessian = derivatives(medium, path, work)
    step = np.linalg.solve(hessian, -gradient)
    assert decrease == pytest.approx(-0.5 * gradient @ step, rel=1e-4)
    moved = np.vstack([path, np.full((3, ndim), np.nan)])
    shift(moved, count, (SIDE,) * ndim, work)
    expected = path.copy()
    expected[1:-1] += np.einsum("ki,kia->ka", step.reshape(count - 2, ndim - 1), work.normal[1 : count - 1])
    assert np.allclose(moved[:count], expected, atol=1e-4 * np.abs(step).max())
    assert np.array_equal(work.before[1 : count - 1], path[1:-1])
    assert np.allclose((work.before + work.move)[1 : count - 1], moved[1 : count - 1])


@pytest.mark.parametrize(("ndim", "slope"), [(2, 0.1), (2, 0.0), (3, 0.0)])
@given(seed=SEEDS)
@settings(deadline=None)
def test_the_medium_bends_the_hessian_of_one_point_exactly(ndim, slope, seed):
    """No term of one inner point is neglected, in 3-D where the slowness has no slope."""
    rng = np.random.default_rng(seed)
    medium, path = Medium(rng, ndim, slope, 0.05), zigzag(rng, 3, ndim)
    medium.origin = path[1].copy()
    work = medium.work(path)
    decrease = factorise(3, (SIDE,) * ndim, True, work)
    gradient, hessian = derivatives(medium, path, work)
    if decrease < 0.0:
        assert np.linalg.eigvalsh(hessian).min() < 1e-3
        return
    assert np.allclose(work.right[1], gradient, atol=1e-6)
    assert np.allclose(np.linalg.inv(work.inverse[1]), hessian, rtol=1e-4, atol=1e-5)
    assert decrease == pytest.approx(0.5 * gradient @ np.linalg.solve(hessian, gradient), rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("ndim", [2, 3])
def test_a_maximum_of_slowness_has_no_positive_hessian_but_tension_has(ndim):
    rng = np.random.default_rng(3)
    medium, path = Medium(rng, ndim), zigzag(rng, 5, ndim, 0.05)
    medium.second = -8.0 * np.eye(ndim)
    work = medium.work(path)
    work.slowness[:5] = 1.0
    work.tension[:4] = 1.0 / work.length[:4]
    assert factorise(5, (SIDE,) * ndim, True, work) == -1.0
    assert factorise(5, (SIDE,) * ndim, False, work) > 0.0


@pytest.mark.parametrize("ndim", [2, 3])
def test_steps_are_limited_and_stay_in_the_grid(ndim):
    """A path far aside and a path along the boundary, pushed outwards."""
    rng = np.random.default_rng(4)
    path = zigzag(rng, 5, ndim, 0.0)
    medium = Medium(rng, ndim, slope=30.0)
    for shape, low, high in ((SIDE, -np.inf, np.inf), (int(path.max()), 0.0, int(path.max()) - 1.0)):
        work, moved = medium.work(path), path.copy()
        # The slopes of a steep medium, its tension that of water.
        work.tension[:4] = 1.0 / work.length[:4]
        assert factorise(5, (shape,) * ndim, False, work) > 0.0
        shift(moved, 5, (shape,) * ndim, work)
        along = np.einsum("kia,ka->ki", work.normal[1:4], moved[1:4] - path[1:4])
        if high == np.inf:
            assert np.abs(along).max() == pytest.approx(MAX_SHIFT)
        assert (moved[1:4] >= max(low, 0.0)).all()
        assert (moved[1:4] <= high).all()
        assert np.array_equal(moved[[0, 4]], path[[0, 4]])

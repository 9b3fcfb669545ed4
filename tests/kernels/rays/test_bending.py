"""Ray bending: exact where paths are known, its quadrature, and Newton steps against differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.rays.bending import STRIDE, _fourth_order, _merge_short_end, bend
from bentray_kernels.rays.newton_step import MAX_SHIFT, allocate_bending, factorise, shift
from bentray_kernels.splines import coefficients


def path_of(points):
    """A path with memory for a few more points."""
    return np.vstack([points, np.zeros((4, points.shape[1]))])


def gradient_medium(n, ndim, rate):
    """Spline of the logarithm of the slowness of speed 1 + rate·x, and the exact time between two points."""
    speed = 1.0 + rate * np.arange(n).reshape((n,) + (1,) * (ndim - 1)) * np.ones((n,) * ndim)

    def exact(a, b):
        squared = ((a - b) ** 2).sum()
        return np.arccosh(1.0 + 0.5 * rate**2 * squared / ((1.0 + rate * a[0]) * (1.0 + rate * b[0]))) / rate

    return coefficients(np.log(1.0 / speed)), exact


@pytest.mark.parametrize("ndim", [2, 3])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_a_wound_path_through_water_becomes_straight(ndim, seed):
    rng = np.random.default_rng(seed)
    shape = (24,) * ndim
    ends = rng.uniform(3.0, 20.0, (2, ndim))
    if np.linalg.norm(ends[1] - ends[0]) < 6.0:
        ends = np.array([np.full(ndim, 4.0), np.full(ndim, 18.0)])
    count = int(np.linalg.norm(ends[1] - ends[0]) / STRIDE) + 2
    points = np.linspace(*ends, count)
    points[1:-1] += 0.3 * rng.normal(size=(count - 2, ndim))
    path = path_of(points)
    spline = coefficients(np.log(np.full(shape, 2.0)))
    time, left = bend(path, count, spline, shape, allocate_bending(len(path), shape))
    assert time == pytest.approx(2.0 * np.linalg.norm(ends[1] - ends[0]), rel=1e-6)
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    off = path[:left] - ends[0]
    assert np.abs(off - np.outer(off @ along, along)).max() < 0.02
    assert np.array_equal(path[0], ends[0])
    assert np.array_equal(path[left - 1], ends[1])


@pytest.mark.parametrize("ndim", [2, 3])
def test_the_time_in_a_gradient_is_exact_to_the_fourth_order(ndim):
    n, rate = 40, 0.05
    shape = (n,) * ndim
    spline, exact = gradient_medium(n, ndim, rate)
    a, b = np.full(ndim, 8.0), np.full(ndim, 30.0)
    b[0] = 14.0
    errors = []
    for count in (6, 11, 21):
        path = path_of(np.linspace(a, b, count))
        time, _ = bend(path, count, spline, shape, allocate_bending(len(path), shape))
        errors.append(abs(time - exact(a, b)))
        speed = 1.0 + rate * path[:count, 0]
        # Rays are circles about a centre where the speed is 0.
        first = np.array([-1.0 / rate, 0.0])
        along = np.linalg.norm(path[:count, 1:] - a[1:], axis=1)
        end = along[-1]
        first[1] = ((b[0] - first[0]) ** 2 + end**2 - (a[0] - first[0]) ** 2) / (2.0 * end)
        radii = np.hypot(path[:count, 0] - first[0], along - first[1])
        assert np.abs(radii / radii[0] - 1.0).max() < 0.1 / count**1.5
        assert (speed > 1.0).all()
    assert errors[0] < 1e-2 * exact(a, b)
    assert errors[2] < errors[0] / 20.0


def filled(points, slowness, slopes):
    """Intermediate values of a path as bending has them before the correction."""
    work = allocate_bending(len(points), (64,) * points.shape[1])
    vector = np.diff(points, axis=0)
    work.vector[:-1], work.length[:-1] = vector, np.linalg.norm(vector, axis=1)
    work.slowness[:], work.slope[:] = slowness, slopes
    work.tension[:-1] = 0.5 * (slowness[1:] + slowness[:-1]) / work.length[:-1]
    trapezoid = (0.5 * (slowness[1:] + slowness[:-1]) * work.length[:-1]).sum()
    return trapezoid, work


@pytest.mark.parametrize("ndim", [2, 3])
def test_the_correction_makes_cubic_slowness_along_a_straight_path_exact(ndim):
    """Euler and Maclaurin: the next term has the third derivative's difference, 0 for a cubic."""
    t = np.array([0.0, 0.7, 2.0, 3.1, 4.0, 5.5])
    along = np.arange(1.0, ndim + 1) / np.linalg.norm(np.arange(1.0, ndim + 1))
    value = 1.0 + 0.3 * t - 0.2 * t**2 + 0.05 * t**3
    slope = 0.3 - 0.4 * t + 0.15 * t**2
    trapezoid, work = filled(3.0 + t[:, None] * along, value, slope[:, None] * along)
    exact = np.polyval([0.05 / 4, -0.2 / 3, 0.15, 1.0, 0.0], t[-1])
    # The remaining error of a cubic: its third derivative is constant, so intervals of any length are exact.
    assert trapezoid + _fourth_order(len(t), (64,) * ndim, work) == pytest.approx(exact, rel=1e-12)
    assert abs(trapezoid - exact) > 0.05


@pytest.mark.parametrize("ndim", [2, 3])
@pytest.mark.parametrize("even", [True, False])
def test_the_correction_of_chords_of_a_circle_is_its_arc(ndim, even):
    errors, plain = [], []
    for count in (6, 11, 21):
        t = np.linspace(0.0, 1.0, count)
        angle = 1.2 * (t if even else t + 0.1 * np.sin(2.0 * np.pi * t) / (2.0 * np.pi))
        points = np.zeros((count, ndim))
        points[:, 0], points[:, -1] = 20.0 * np.cos(angle), 20.0 * np.sin(angle)
        chords, work = filled(points, np.full(count, 3.0), np.zeros((count, ndim)))
        errors.append(abs(chords + _fourth_order(count, (64,) * ndim, work) - 3.0 * 24.0))
        plain.append(abs(chords - 3.0 * 24.0))
    assert errors[0] < 0.05 * plain[0]
    assert errors[2] < errors[0] / 100.0


@pytest.mark.parametrize(("rest", "left"), [(0.4, 3), (0.6, 4)])
def test_a_short_last_step_is_merged(rest, left):
    path = path_of(np.array([[0.0, 5.0], [1.0, 5.0], [2.0, 5.0], [2.0 + rest, 5.0]]))
    assert _merge_short_end(path, 4, 2) == left
    assert path[left - 1].tolist() == [2.0 + rest, 5.0]
    assert path[left - 2].tolist() == ([1.0, 5.0] if left == 3 else [2.0, 5.0])
    assert _merge_short_end(path[[0, 3]], 2, 2) == 2


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

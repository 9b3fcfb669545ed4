"""Rays arrive, are straight where they should be, and integrate to the travel time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal, rays
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.rays.fan import _inside, squared_gradient
from bentray_kernels.rays.squared_time_spline import spline_slope, squared_time_spline
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.solver_choice import solver_of

from ...effort import effort
from ...opencl import methods
from .problems import gradient_speed, gradient_times, rough_problem


@pytest.mark.parametrize("gradient", ["differences", "bspline"])
@pytest.mark.parametrize("ndim", [2, 3])
def test_homogeneous_rays_are_straight(ndim, gradient):
    rng = np.random.default_rng(1)
    source, receivers = rng.random(ndim), rng.random((12, ndim))
    receivers[0] = np.round(receivers[0])
    tof = eikonal.solve(np.full((24,) * ndim, 1500.0), 1.0 / 23, source)
    paths = rays.trace(tof, 1.0 / 23, receivers, source, gradient=gradient)
    for path, receiver in zip(paths, receivers, strict=True):
        along = (source - receiver) / np.linalg.norm(source - receiver)
        off = path - receiver
        assert np.linalg.norm(off - np.outer(off @ along, along), axis=1).max() < 1e-6
        np.testing.assert_allclose([path[0], path[-1]], [receiver, source], atol=1e-12)


def circle_error(nodes, gradient="differences", solved=False):
    """Largest relative error of the radii of rays in a gradient, which are circles."""
    source, receivers = np.array([0.2, 0.1]), np.column_stack((np.linspace(0.1, 0.9, 9), np.full(9, 0.9)))
    places = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, nodes)] * 2, indexing="ij"), axis=-1)
    spacing = 1.0 / (nodes - 1)
    tof = eikonal.solve(gradient_speed(nodes), spacing, source) if solved else gradient_times(places, source)
    errors = []
    for path, end in zip(
        rays.trace(tof, spacing, receivers, source, gradient=gradient), receivers, strict=True
    ):
        # The centre lies on x = -1/4, where the speed would be 0, equally far from both ends.
        y = (end[1] ** 2 + (end[0] + 0.25) ** 2 - source[1] ** 2 - (source[0] + 0.25) ** 2) / (
            2.0 * (end[1] - source[1])
        )
        radii = np.linalg.norm(path - np.array([-0.25, y]), axis=1)
        errors.append(np.abs(radii / np.linalg.norm(source - np.array([-0.25, y])) - 1.0).max())
    return max(errors)


def test_rays_in_a_gradient_are_the_known_circles():
    """Down exact times they are met ten times nearer than by steps of first order, and nearer by splines."""
    assert circle_error(201, solved=True) < 2e-3
    assert circle_error(101) < 5e-4
    assert circle_error(33, "bspline") < 0.5 * circle_error(33)


@given(factors=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6), flat=st.booleans())
@settings(max_examples=effort(20, 30), deadline=None)
def test_gradient_of_a_parabola_is_exact_on_the_rim_too(factors, flat):
    shape = (6, 3) if flat else (3, 5, 4)
    strides = tuple(int(np.prod(shape[k + 1 :])) for k in range(len(shape)))
    axes = np.meshgrid(*map(np.arange, shape), indexing="ij")
    terms = [factors[k] * x + factors[k + 3] * x**2 for k, x in enumerate(axes)]
    tof = np.sqrt(sum(terms) + 200.0)
    slope = [factors[k] + 2.0 * factors[k + 3] * x for k, x in enumerate(axes)]
    gradient = squared_gradient(tof.ravel(), shape, strides)
    assert np.allclose(gradient, np.stack([x.ravel() for x in slope], axis=1), atol=1e-9)


def test_slowness_along_the_ray_is_the_travel_time():
    """Fermat: the integral along the traced ray is nearer the exact time than the travel time it follows."""
    n, points = 128, 0.5 + Ring(40, 0.45).positions()
    speed, spacing = gradient_speed(n), 1.0 / (n - 1)
    matrix = rays.sensitivities(eikonal.solve(speed, spacing, points[0]), spacing, points[1:], points[0])
    assert np.abs(matrix @ (1.0 / speed).ravel() - gradient_times(points[1:], points[0])).max() < 5e-5
    assert matrix.shape == (39, n * n)


@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans())
@settings(max_examples=effort(20, 40), deadline=None)
def test_no_ray_is_lost_in_rough_models(seed, flat):
    speed, source, receivers = rough_problem(seed, flat, 0.2, 5.0)
    last = np.array(speed.shape) - 1.0
    for method in methods():
        tof = eikonal.solve(speed, 1.0, source, method)
        for path, receiver in zip(rays.trace(tof, 1.0, receivers, source), receivers, strict=True):
            assert np.allclose(path[0], receiver)
            assert np.allclose(path[-1], source)
            assert (path >= 0.0).all()
            assert (path <= last).all()
            steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
            assert steps.max() <= np.sqrt(speed.ndim) + 1e-9


@pytest.mark.parametrize("kind", ["curved", "straight"])
@given(seed=st.integers(0, 2**32 - 1), flat=st.booleans())
@settings(max_examples=effort(20, 25), deadline=None)
def test_sensitivities_are_the_lengths_of_the_rays(kind, seed, flat):
    speed, source, receivers = rough_problem(seed, flat, 1.0, 2.0)
    tof = eikonal.solve(speed, 0.3, source * 0.3)
    matrix = rays.sensitivities(tof, 0.3, receivers * 0.3, source * 0.3, kind=kind)
    paths = rays.trace(tof, 0.3, receivers * 0.3, source * 0.3, kind=kind)
    lengths = [np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths]
    assert np.allclose(matrix.sum(axis=1), lengths, rtol=1e-12)
    assert (matrix.data > 0.0).all()
    assert all(len(set(row.indices)) == row.nnz for row in matrix)


def test_straight_rays_need_only_the_grid():
    path = rays.trace(np.zeros((9, 9)), 0.5, [[4.0, 1.0]], (0.0, 0.5), kind="straight")[0]
    assert np.allclose(path[:, 1], 0.5 + path[:, 0] / 8.0)


def test_receiver_on_the_source_has_no_ray():
    tof = eikonal.solve(np.ones((8, 8)), 1.0, (3.0, 3.0))
    for kind in ("curved", "straight"):
        assert rays.sensitivities(tof, 1.0, [[3.0, 3.0]], (3.0, 3.0), kind=kind).sum() == 0.0


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"tof": np.ones(5)}, "tof"),
        ({"tof": np.full((4, 4), np.inf)}, "tof"),
        ({"spacing": -1.0}, "spacing"),
        ({"receivers": [[1.0, 9.0]]}, "receivers"),
        ({"receivers": [[1.0, np.nan]]}, "receivers"),
        ({"receivers": [1.0, 2.0]}, "receivers"),
        ({"source": [1.0, -0.1]}, "source"),
        ({"source": [1.0]}, "source"),
        ({"kind": "wavy"}, "kind"),
    ],
)
def test_bad_input_is_named(change, field):
    arguments = {
        "tof": np.ones((4, 4)),
        "spacing": 1.0,
        "receivers": [[1.0, 2.0]],
        "source": (0.0, 0.0),
        **change,
    }
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        rays.trace(**arguments)


def test_points_outside_by_rounding_are_moved_onto_the_grid():
    points = np.array([[-1e-10, 3.0], [4.0, 7.0 + 1e-10]])
    inside = _inside("receivers", points, np.array([7.0, 7.0]), 1e-3)
    np.testing.assert_array_equal(inside, [[0.0, 3.0], [4.0, 7.0]])


@kernel
def slopes_at(spline, shape, points, slopes):
    for k in range(len(points)):
        spline_slope(spline, shape, points[k], slopes[k])


@pytest.mark.parametrize("shape", [(9, 12), (5, 6, 7), (2, 8), (8, 3, 4)])
def test_slopes_of_a_paraboloid_are_exact_up_to_the_faces(shape):
    source, metric = np.array([1.3, 4.1, 0.6])[: len(shape)], np.array([2.0, 1.0, 3.0])[: len(shape)]
    # Two nodes hold no bend.
    metric = np.where(np.array(shape) == 2, 0.0, metric)
    away = np.indices(shape) - source.reshape(-1, *(1,) * len(shape))
    times = np.sqrt(np.tensordot(metric, away**2, 1) + 4.0)
    points = np.random.default_rng(0).random((50, len(shape))) * (np.array(shape) - 1)
    points[:8] = np.round(points[:8] / (np.array(shape) - 1)) * (np.array(shape) - 1)
    result = np.empty_like(points)
    slopes_at(squared_time_spline(times), shape, points, result)
    np.testing.assert_allclose(result, 2.0 * metric * (points - source), atol=1e-6)


def test_one_layer_of_nodes_has_no_slope_across():
    times = np.sqrt(np.indices((9, 8, 1))[0] ** 2 + 1.0)
    result = np.empty((1, 3))
    slopes_at(squared_time_spline(times), times.shape, np.array([[4.5, 3.0, 0.0]]), result)
    np.testing.assert_allclose(result, [[9.0, 0.0, 0.0]], atol=1e-6)


def test_sensitivities_follow_the_same_rays():
    speed = 1.0 + np.linspace(0.0, 1.0, 30)[:, None] * np.ones(30)
    source, receivers = (0.1, 0.2), [(0.9, 0.8), (0.2, 0.9)]
    tof = eikonal.solve(speed, 1.0 / 29, source)
    how = {"gradient": "bspline"}
    paths = rays.trace(tof, 1.0 / 29, receivers, source, **how)
    rows = rays.sensitivities(tof, 1.0 / 29, receivers, source, **how)
    lengths = [np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths]
    np.testing.assert_allclose(rows.sum(axis=1), lengths, rtol=1e-12)
    assert abs(rows - rays.sensitivities(tof, 1.0 / 29, receivers, source)).max() > 0.0


def test_the_setting_replaces_the_compiled_pass():
    sart = Settings.from_values(method="sart")
    assert solver_of(sart, 2).compiled
    assert solver_of(sart.changed(ray_gradient="bspline"), 2) == (False, "accurate")
    assert solver_of(sart.changed(ray_gradient="bspline", rays="straight"), 2).compiled


def test_unknown_gradients_are_rejected():
    with pytest.raises(InvalidInput, match="gradient"):
        rays.trace(np.ones((4, 4)), 1.0, [(1.0, 1.0)], (2.0, 2.0), gradient="sobel")
    with pytest.raises(InvalidInput, match="ray_gradient"):
        Settings.from_values(ray_gradient="sobel")


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (1, 1, 9)])
def test_a_grid_may_be_one_node_wide(shape):
    source = np.zeros(len(shape))
    time = eikonal.solve(np.full(shape, 1500.0), 1e-3, source)
    far = 1e-3 * (np.array([shape]) - 1.0)
    (path,) = rays.trace(time, 1e-3, far, source)
    np.testing.assert_allclose(path, far * np.linspace(1.0, 0.0, 9)[:, None], atol=1e-9)

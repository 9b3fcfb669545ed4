"""Rays by the B-spline of T²: exact for paraboloids, nearer to known circles than central differences."""

import numpy as np
import pytest

from bentray_kernels import eikonal, rays
from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.rays.squared_time_spline import spline_slope, squared_time_spline
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.solver_choice import solver_of


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


@pytest.mark.parametrize("ndim", [2, 3])
def test_homogeneous_rays_are_straight(ndim):
    rng = np.random.default_rng(1)
    source, receivers = rng.random(ndim), rng.random((12, ndim))
    receivers[0] = np.round(receivers[0])
    tof = eikonal.solve(np.full((24,) * ndim, 1500.0), 1.0 / 23, source)
    for path, receiver in zip(
        rays.trace(tof, 1.0 / 23, receivers, source, gradient="bspline"), receivers, strict=True
    ):
        along = (source - receiver) / np.linalg.norm(source - receiver)
        off = path - receiver
        assert np.linalg.norm(off - np.outer(off @ along, along), axis=1).max() < 1e-6


def circle_error(nodes, gradient):
    """Largest distance of rays in a speed of 1 + 4x from their circles, given exact travel times."""
    x = np.arange(nodes) / (nodes - 1)
    source = np.array([0.2, 0.1])
    squared = (x[:, None] - source[0]) ** 2 + (x[None, :] - source[1]) ** 2
    tof = np.arccosh(1.0 + 8.0 * squared / ((1.0 + 4.0 * source[0]) * (1.0 + 4.0 * x[:, None]))) / 4.0
    receivers = np.column_stack((np.linspace(0.1, 0.9, 9), np.full(9, 0.9)))
    worst = 0.0
    for path, end in zip(
        rays.trace(tof, 1.0 / (nodes - 1), receivers, source, gradient=gradient), receivers, strict=True
    ):
        # The centre lies on x = -1/4, equally far from both ends.
        y = (end[1] ** 2 + (end[0] + 0.25) ** 2 - source[1] ** 2 - (source[0] + 0.25) ** 2) / (
            2.0 * (end[1] - source[1])
        )
        radii = np.linalg.norm(path - np.array([-0.25, y]), axis=1)
        worst = max(worst, np.abs(radii - np.linalg.norm(source - np.array([-0.25, y]))).max())
    return worst


def test_rays_in_a_gradient_are_nearer_to_the_known_circles():
    assert circle_error(33, "bspline") < 0.5 * circle_error(33, "differences")


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

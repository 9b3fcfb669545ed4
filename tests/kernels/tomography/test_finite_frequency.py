"""Finite-frequency rays: forward blur and adjoint, the thin limit, and the gain on wide times."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Problem, Settings, reconstruct, rmse
from bentray_kernels.tomography.finite_frequency import (
    BENDS_WIDER,
    blurred,
    front_smoothing,
    ray_slowness,
    width_in_nodes,
)
from bentray_kernels.tomography.gauss_newton import gauss_newton_step

from ..straight_scans import ring_scan

WATER = 1500.0
WIDTH = 0.009
PLAN = Settings.from_values(method="gauss-newton", nodes=40, ray_width_m=WIDTH)


def scan(delta=None):
    return ring_scan(32, 0.08, delta, WATER)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 6.0))
@settings(max_examples=20, deadline=None)
def test_the_blur_is_linear_and_its_own_adjoint(seed, width):
    random = np.random.default_rng(seed)
    first, two = random.normal(size=(2, 13, 17))
    assert np.vdot(blurred(first, width), two) == pytest.approx(np.vdot(first, blurred(two, width)), abs=1e-9)
    both = blurred(first + 2.0 * two, width)
    assert np.allclose(both, blurred(first, width) + 2.0 * blurred(two, width), atol=1e-12)


def test_thin_rays_see_the_image_itself_and_water_stays_water():
    problem = Problem.from_dataset(scan(), PLAN)
    image = np.full(problem.region.shape, 1.0 / WATER)
    assert np.array_equal(ray_slowness(problem, PLAN, image), image)
    image[20, 20] *= 1.1
    assert ray_slowness(problem, PLAN.changed(ray_width_m=0.0), image) is image
    wide = ray_slowness(problem, PLAN, image)
    assert 1.0 / WATER < wide[20, 20] < image[20, 20]
    assert (wide - 1.0 / WATER).sum() == pytest.approx((image - 1.0 / WATER).sum(), rel=1e-3)


def test_rays_bend_in_an_image_blurred_by_twice_their_width():
    problem = Problem.from_dataset(scan(), PLAN)
    width = width_in_nodes(problem, PLAN)
    assert width == pytest.approx(WIDTH / problem.spacing)
    assert np.hypot(width, front_smoothing(problem, PLAN)) == pytest.approx(BENDS_WIDER * width)
    assert front_smoothing(problem, PLAN.changed(ray_width_m=0.0)) == 0.0


def test_wide_times_select_wide_rays():
    """Times that rays of this width would take: thin ones make a blurred disc of them."""
    plan = replace(PLAN, rays="straight")
    problem = Problem.from_dataset(scan(), plan)
    axis = (np.arange(40) - 19.5) * problem.spacing
    far = np.hypot(axis[:, None] - 0.01, axis[None, :])
    true = WATER + 60.0 * (far < 0.02)
    rows = gauss_newton_step.trace_rays(problem, plan, 1.0 / true, problem.active_emitters)
    delta = np.full(problem.delta_tof.shape, np.nan)
    delta[np.isfinite(problem.delta_tof)] = -rows.residual
    wide = reconstruct(scan(delta), plan)
    thin = reconstruct(scan(delta), plan.changed(ray_width_m=0.0))
    errors = [rmse(image.speed, true, problem.region) for image in (wide, thin)]
    assert errors[0] < 0.75 * errors[1]


@pytest.mark.parametrize("method", ["sart", "auto", "waveform"])
def test_other_methods_refuse_a_width(method):
    with pytest.raises(InvalidInput, match="ray_width_m"):
        Settings.from_values(method=method, ray_width_m=1e-3)

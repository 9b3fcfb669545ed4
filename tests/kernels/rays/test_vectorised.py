"""Vectorised rays: straight in water, equal to single rays in tissue, all of them arrive."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from bentray_kernels.eikonal import solve
from bentray_kernels.rays import sensitivities
from bentray_kernels.rays.vectorised import STRIDE, allocate_bundle, back_project, interleave, trace_bundle

from ...effort import effort

SHAPE = (60, 50)


def interleaved(deviation, slowness):
    out = np.empty(4 * deviation.size, np.float32)
    interleave(
        deviation.astype(np.float32).ravel(), slowness.astype(np.float32).ravel(), deviation.shape, out
    )
    return out


def traced(fields, shape, source, receivers):
    """The allocate_bundle of all rays, the longest first, and how many steps it took."""
    rays = allocate_bundle(len(receivers), shape)
    rays.x[:], rays.y[:] = receivers.T
    return rays, trace_bundle(source[0], source[1], fields, shape, len(receivers), rays)


def longest_first(source, receivers):
    return receivers[np.argsort(-np.linalg.norm(receivers - source, axis=1))]


def points(rng, count, shape=SHAPE):
    return rng.uniform(0.0, np.array(shape) - 1.0, (count, 2))


def back_projected(correction, steps, rays, shape=SHAPE):
    out = np.zeros(2 * shape[0] * shape[1], np.float32)
    back_project(correction.astype(np.float32), steps, shape, rays, out)
    return out.reshape(-1, 2).T


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 20))
@settings(max_examples=effort(20, 25), deadline=None)
def test_rays_through_water_are_straight(seed, count):
    rng = np.random.default_rng(seed)
    source = points(rng, 1)[0]
    receivers = longest_first(source, points(rng, count))
    rays, steps = traced(interleaved(np.zeros(SHAPE), np.full(SHAPE, 1.0)), SHAPE, source, receivers)
    distance = np.linalg.norm(receivers - source, axis=1)
    assert np.allclose(rays.length, distance, atol=2e-3)
    assert np.allclose(rays.time, rays.length, rtol=1e-5, atol=1e-5)
    assert steps <= distance.max() / STRIDE + 2
    for step in range(steps):
        active = rays.active[step]
        middle = np.stack([rays.middle_x[step, :active], rays.middle_y[step, :active]], axis=1)
        off, along = middle - source, (receivers - source)[:active]
        across = off[:, 0] * along[:, 1] - off[:, 1] * along[:, 0]
        assert np.abs(across / np.maximum(distance[:active], 1e-3)).max() < 1e-2
    weights = back_projected(np.full(count, 2.0), steps, rays)
    assert weights[1].sum() == pytest.approx(rays.length.sum(), rel=1e-4, abs=1e-3)
    assert np.allclose(weights[0], 2.0 * weights[1], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("shape", [(7, 5), (2, 2), (2, 6), (5, 2)])
def test_slopes_of_a_plane_are_exact_at_every_node_and_those_of_a_parabola_inside(shape):
    i, j = np.indices(shape).astype(float)
    slowness = 1.0 + 0.1 * i + 0.01 * j
    plane = interleaved(0.5 + 3.0 * i - 2.0 * j, slowness).reshape(*shape, 4)
    assert np.allclose(plane[..., 0], 3.0)
    assert np.allclose(plane[..., 1], -2.0)
    assert np.allclose(plane[..., 2], slowness)
    assert not plane[..., 3].any()
    bowl = interleaved(0.5 * i**2 - 1.5 * j**2, slowness).reshape(*shape, 4)
    assert np.allclose(bowl[1:-1, :, 0], i[1:-1])
    assert np.allclose(bowl[:, 1:-1, 1], -3.0 * j[:, 1:-1])


def tissue():
    """Slowness over that of the source, and the rays' ends."""
    x, y = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in SHAPE), indexing="ij")
    slowness = 1.0 + 0.06 * np.exp(-((x - 0.1) ** 2 + y**2) / 0.1)
    source = np.array([2.3, 20.6])
    receivers = longest_first(source, np.array([[57.0, float(k)] for k in range(4, 46, 3)]))
    return slowness, source, receivers


def test_rays_through_tissue_are_those_of_the_tracer():
    slowness, source, receivers = tissue()
    tof = solve(1.0 / slowness, 1.0, source)
    rows = sensitivities(tof, 1.0, receivers, source)
    x, y = (np.arange(n) for n in SHAPE)
    deviation = tof - np.hypot(x[:, None] - source[0], y[None, :] - source[1])
    rays, steps = traced(interleaved(deviation, slowness), SHAPE, source, receivers)
    straight, _ = traced(interleaved(np.zeros(SHAPE), slowness), SHAPE, source, receivers)
    assert np.allclose(rays.time, rows @ slowness.ravel(), atol=2e-3)
    assert (straight.time - rays.time).max() > 0.05
    correction = np.linspace(-1.0, 1.0, len(receivers))
    worth_passed, passed = (sums.reshape(SHAPE) for sums in back_projected(correction, steps, rays))
    for computed, truth in ((worth_passed, rows.T @ correction), (passed, rows.sum(axis=0))):
        # Longer steps give single nodes more or less; the neighbourhood has the same.
        wanted = gaussian_filter(truth.reshape(SHAPE), 1.5)
        assert np.abs(gaussian_filter(computed, 1.5) - wanted).mean() < 0.03 * np.abs(wanted).mean()


def test_spreading_adds():
    slowness, source, receivers = tissue()
    rays, steps = traced(interleaved(np.zeros(SHAPE), slowness), SHAPE, source, receivers)
    correction = np.ones(len(receivers), np.float32)
    once = back_projected(correction, steps, rays)
    out = np.zeros(2 * once.shape[1], np.float32)
    for _ in range(2):
        back_project(correction, steps, SHAPE, rays, out)
    assert np.allclose(out.reshape(-1, 2).T, 2.0 * once, rtol=1e-5, atol=1e-6)


def test_trapped_ray_becomes_straight_and_others_are_unchanged():
    slowness, source, receivers = tissue()
    rays, _ = traced(interleaved(np.zeros(SHAPE), slowness), SHAPE, source, receivers)
    # A deviation that falls away from the source, twice as steeply as the distance grows, in the far half.
    x, y = (np.arange(n) for n in SHAPE)
    distance = np.hypot(x[:, None] - source[0], y[None, :] - source[1])
    uphill = np.where(distance > 30.0, 60.0 - 2.0 * distance, 0.0)
    near = np.array([[10.0, 22.0]])
    caught, steps = traced(interleaved(uphill, slowness), SHAPE, source, np.concatenate([receivers, near]))
    assert np.allclose(caught.length[:-1], np.linalg.norm(receivers - source, axis=1), atol=1e-2)
    assert np.allclose(caught.time[:-1], rays.time, atol=1e-2)
    assert caught.length[-1] == pytest.approx(np.linalg.norm(near[0] - source), abs=1e-2)
    weights = back_projected(np.ones(len(receivers) + 1), steps, caught)
    assert weights[1].sum() == pytest.approx(caught.length.sum(), rel=1e-3)


def test_a_receiver_at_the_source_has_no_length():
    rays, steps = traced(
        interleaved(np.zeros((4, 4)), np.ones((4, 4))), (4, 4), (1.5, 2.0), np.array([[1.5, 2.0]])
    )
    assert rays.length[0] == rays.time[0] == 0.0
    assert not back_projected(np.ones(1), steps, rays, (4, 4)).any()

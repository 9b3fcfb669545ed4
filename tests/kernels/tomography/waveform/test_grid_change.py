"""Images and curvature on the grid of the next band, and L-BFGS directions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.tomography.waveform.grid_change import resampled, resampled_pairs
from bentray_kernels.tomography.waveform.inversion_state import Curvature, Image
from bentray_kernels.tomography.waveform.lbfgs import MEMORY, append_pair, search_direction

from ....effort import effort

COARSE, FINE = 2e-3, 1.25e-3
# Node 0 of both grids; the second one lies within the first.
ORIGIN, INNER = (-0.02, -0.03), (-0.01875, -0.02875)
SHAPE, INNER_SHAPE = (21, 31), (31, 47)
LOW_HZ, HIGH_HZ = 2e5, 3e5


def nodes(spacing, origin, shape):
    return np.meshgrid(
        *(o + spacing * np.arange(n) for o, n in zip(origin, shape, strict=True)), indexing="ij"
    )


def lobe(x, y, at):
    return np.exp(-(((x - at) ** 2 + (y + at) ** 2) / 0.009**2))


def stiffness(x, y, hz):
    """Second derivative of a misfit by the speed, per area."""
    return (3.0 + np.sin(80.0 * x) + np.cos(60.0 * y)) * hz**2


def pairs(spacing, origin, shape, hz):
    """Steps, and the changes of the gradient by nodes of a misfit without links between nodes."""
    x, y = nodes(spacing, origin, shape)
    steps = np.stack([lobe(x, y, at) for at in (-0.006, 0.0, 0.007)])
    return steps, steps * stiffness(x, y, hz) * spacing**2


def test_pairs_are_those_of_the_same_misfit_on_the_new_grid():
    curvature = Curvature(*pairs(COARSE, ORIGIN, SHAPE, LOW_HZ), COARSE, ORIGIN, LOW_HZ)
    everywhere = np.ones(INNER_SHAPE, dtype=bool)
    computed = resampled_pairs(curvature, HIGH_HZ, FINE, INNER, everywhere)
    for got, expected in zip(computed, pairs(FINE, INNER, INNER_SHAPE, HIGH_HZ), strict=True):
        assert np.abs(got - expected).max() < 0.02 * np.abs(expected).max()


def test_the_first_direction_of_a_band_is_the_newton_step_as_far_as_the_pairs_reach():
    curvature = Curvature(*pairs(COARSE, ORIGIN, SHAPE, LOW_HZ), COARSE, ORIGIN, LOW_HZ)
    steps, changes = resampled_pairs(curvature, HIGH_HZ, FINE, INNER, np.ones(INNER_SHAPE, dtype=bool))
    own, gradients = pairs(FINE, INNER, INNER_SHAPE, HIGH_HZ)
    wanted, gradient = (0.7 * part[-1] for part in (own, gradients))
    result = search_direction(gradient, steps, changes, lambda image: image)
    assert np.abs(result - wanted).max() < 0.03 * np.abs(wanted).max()


def test_nodes_that_are_fixed_have_no_pairs():
    curvature = Curvature(*pairs(COARSE, ORIGIN, SHAPE, LOW_HZ), COARSE, ORIGIN, LOW_HZ)
    x, y = nodes(FINE, INNER, INNER_SHAPE)
    region = np.hypot(x, y) < 0.012
    for part in resampled_pairs(curvature, HIGH_HZ, FINE, INNER, region):
        assert not part[:, ~region].any()
        assert part[:, region].any()


def test_a_pair_without_curvature_on_the_new_nodes_is_left_out():
    steps, changes = pairs(COARSE, ORIGIN, SHAPE, LOW_HZ)
    changes[1] *= -1.0
    curvature = Curvature(steps, changes, COARSE, ORIGIN, LOW_HZ)
    result, _ = resampled_pairs(curvature, HIGH_HZ, FINE, INNER, np.ones(INNER_SHAPE, dtype=bool))
    assert len(result) == 2


@pytest.mark.parametrize("spacing", [COARSE, FINE])
def test_an_image_keeps_its_range_and_is_extrapolated_by_its_edge(spacing):
    x, y = nodes(COARSE, ORIGIN, SHAPE)
    image = Image(1500.0 + 40.0 * (x + y > 0.0), COARSE, ORIGIN)
    result = resampled(image, spacing, (-0.03, -0.04), (64, 64))
    assert (result.min(), result.max()) == (1500.0, 1540.0)
    assert result[0, 0] == pytest.approx(image.speed[0, 0])


def same(image):
    return image


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=effort(20, 30), deadline=None)
def test_a_quadratic_is_solved(seed):
    rng = np.random.default_rng(seed)
    factor = rng.standard_normal((6, 6))
    curvature = factor @ factor.T + np.eye(6)
    aim = rng.standard_normal(6)
    position = np.zeros(6)
    steps = changes = np.zeros((0, 2, 3))
    for _ in range(40):
        gradient = curvature @ (position - aim)
        if np.linalg.norm(gradient) < 1e-10:
            break
        way = -search_direction(gradient.reshape(2, 3), steps, changes, same).ravel()
        assert way @ gradient < 0.0
        length = -(way @ gradient) / (way @ curvature @ way)
        steps, changes = append_pair(
            steps, changes, (length * way).reshape(2, 3), (length * curvature @ way).reshape(2, 3)
        )
        position = position + length * way
    assert np.allclose(position, aim, atol=1e-6)


def test_without_pairs_the_prior_decides():
    gradient = np.arange(6.0).reshape(2, 3)
    none = np.zeros((0, 2, 3))
    assert np.array_equal(search_direction(gradient, none, none, lambda image: 3.0 * image), 3.0 * gradient)


def test_only_so_many_pairs_are_kept_and_none_of_negative_curvature():
    steps = changes = np.zeros((0, 2, 3))
    for k in range(10):
        steps, changes = append_pair(steps, changes, np.full((2, 3), k + 1.0), np.ones((2, 3)))
    assert steps[:, 0, 0].tolist() == [3.0 + k for k in range(MEMORY)]
    kept, _ = append_pair(steps, changes, np.ones((2, 3)), -np.ones((2, 3)))
    assert kept is steps

"""L-BFGS: exact for quadratics, always a descent direction, limited memory."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.tomography.waveform.lbfgs import append_pair, search_direction

from ....effort import effort


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
            steps, changes, (length * way).reshape(2, 3), (length * curvature @ way).reshape(2, 3), 6
        )
        position = position + length * way
    assert np.allclose(position, aim, atol=1e-6)


def test_without_pairs_the_prior_decides():
    gradient = np.arange(6.0).reshape(2, 3)
    none = np.zeros((0, 2, 3))
    assert np.array_equal(search_direction(gradient, none, none, lambda image: 3.0 * image), 3.0 * gradient)


def test_only_so_many_pairs_are_kept_and_none_of_negative_curvature():
    steps = changes = np.zeros((0, 2, 3))
    for k in range(5):
        steps, changes = append_pair(steps, changes, np.full((2, 3), k + 1.0), np.ones((2, 3)), 3)
    assert steps[:, 0, 0].tolist() == [3.0, 4.0, 5.0]
    kept, _ = append_pair(steps, changes, np.ones((2, 3)), -np.ones((2, 3)), 3)
    assert kept is steps

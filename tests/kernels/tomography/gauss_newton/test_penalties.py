"""The differences that penalties measure: adjoints, what they leave alone, shrinking."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.tomography.gauss_newton.penalties import adjoint, gradient, laplacian, shrink

from ....effort import effort

SHAPES = st.lists(st.integers(1, 7), min_size=2, max_size=3).map(tuple)


@given(shape=SHAPES, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=effort(20, 50), deadline=None)
def test_gradient_and_its_adjoint(shape, seed):
    rng = np.random.default_rng(seed)
    image, slope = rng.normal(size=shape), rng.normal(size=(len(shape), *shape))
    assert abs((gradient(image) * slope).sum() - (image * adjoint(slope)).sum()) < 1e-12 * (
        1 + np.prod(shape)
    )


@given(shape=SHAPES, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=effort(20, 50), deadline=None)
def test_laplacian_is_its_own_adjoint_and_never_positive(shape, seed):
    rng = np.random.default_rng(seed)
    one, other = rng.normal(size=(2, *shape))
    assert abs((laplacian(one) * other).sum() - (one * laplacian(other)).sum()) < 1e-11 * (1 + np.prod(shape))
    assert (laplacian(one) * one).sum() <= 0.0


@pytest.mark.parametrize("axes", [2, 3])
def test_second_differences_of_a_parabola_and_of_a_plane(axes):
    position = np.indices((6,) * axes).astype(float)
    inner = (slice(1, -1),) * axes
    assert np.allclose(laplacian((position**2).sum(axis=0))[inner], 2.0 * axes)
    assert np.allclose(laplacian(position.sum(axis=0))[inner], 0.0)


def test_gradient_covers_every_axis():
    position = np.indices((3, 4, 5)).astype(float)
    slope = gradient(position[0] + 10.0 * position[1] + 100.0 * position[2])
    assert np.array_equal(slope[:, 0, 0, 0], [1.0, 10.0, 100.0])
    assert (slope[0, -1] == 0.0).all()
    assert (slope[2, :, :, -1] == 0.0).all()


def test_shrinking_takes_off_the_same_length_everywhere():
    slope = np.array([[[3.0, 0.0, 0.1]], [[4.0, 0.0, 0.0]]])
    assert np.allclose(shrink(slope, 1.0), [[[2.4, 0.0, 0.0]], [[3.2, 0.0, 0.0]]])


def test_shrinking_by_lengths_of_their_own():
    slope = np.array([[[3.0, 0.0, 0.1]], [[4.0, 0.0, 0.0]]])
    assert np.allclose(shrink(slope, np.array([[2.5, 1.0, 0.05]])), [[[1.5, 0.0, 0.05]], [[2.0, 0.0, 0.0]]])

"""The linear problem with total variation: the adjoint, the limits it must have, edges kept sharp."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import random_array

from bentray_kernels.tomography.linearisation import Rows
from bentray_kernels.tomography.total_variation import Linearised, adjoint, gradient, shrink


@given(shape=st.tuples(st.integers(1, 9), st.integers(1, 9)), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_gradient_and_its_adjoint(shape, seed):
    rng = np.random.default_rng(seed)
    image, slope = rng.normal(size=shape), rng.normal(size=(2, *shape))
    assert abs((gradient(image) * slope).sum() - (image * adjoint(slope)).sum()) < 1e-12 * (
        1 + np.prod(shape)
    )


def test_shrinking_takes_off_the_same_length_everywhere():
    slope = np.array([[[3.0, 0.0, 0.1]], [[4.0, 0.0, 0.0]]])
    assert np.allclose(shrink(slope, 1.0), [[[2.4, 0.0, 0.0]], [[3.2, 0.0, 0.0]]])


def rows_of(matrix, residual):
    sparse = matrix.tocsr()
    return Rows(
        sparse.indptr.astype(np.int64), sparse.indices.astype(np.int32), sparse.data, residual, emitters=1
    )


def problem(strength, truth, *, rows=400, bounds=(-9.0, 9.0), region=None, start=0.0):
    n = len(truth)
    region = np.ones((n, n), dtype=bool) if region is None else region
    matrix = random_array((rows, n * n), density=0.1, dtype=np.float32, rng=np.random.default_rng(5))
    image = np.full((n, n), start)
    residual = matrix @ (truth - image).ravel()
    density = float(matrix.sum() / region.sum())
    return Linearised([rows_of(matrix, residual)], image, density, region, bounds, strength)


def settled(linearised):
    """The solution after several calls, each from the dual variable of the last."""
    dual = np.zeros((2, *linearised.image.shape))
    for _ in range(20):
        image, dual = linearised.solve(dual)
    return image


TRUTH = np.where(np.hypot(*(np.indices((12, 12)) - 5.5)) < 4.0, 1.0, 0.0)


def test_without_total_variation_exact_data_give_the_truth():
    assert np.abs(settled(problem(0.0, TRUTH)) - TRUTH).max() < 0.05


def test_few_data_suffice_for_few_edges():
    """Half as many rays as nodes: least squares cannot know, total variation does."""
    blurred = settled(problem(0.0, TRUTH, rows=70))
    sharp = settled(problem(0.01, TRUTH, rows=70))
    assert np.abs(sharp - TRUTH).mean() < 0.6 * np.abs(blurred - TRUTH).mean()


def test_much_total_variation_leaves_no_edge():
    image = settled(problem(1e3, TRUTH))
    assert np.ptp(image) < 1e-3


def test_bounds_and_region_hold():
    region = np.zeros((12, 12), dtype=bool)
    region[2:10, 2:10] = True
    image = settled(problem(0.01, TRUTH, bounds=(0.1, 0.7), region=region, start=0.2))
    assert (image[~region] == 0.2).all()
    assert image.min() >= 0.1
    assert image.max() <= 0.7


@pytest.mark.parametrize("cuts", [1, 3])
def test_parts_of_the_rows_give_the_bits_of_the_whole(cuts):
    whole = problem(0.05, TRUTH, rows=30)
    part = whole.parts[0]
    ends = [0, *np.linspace(0, 30, cuts + 1).astype(int)[1:]]
    parts = []
    for first, last in itertools.pairwise(ends):
        entries = slice(part.pointers[first], part.pointers[last])
        parts.append(
            Rows(
                part.pointers[first : last + 1] - part.pointers[first],
                part.columns[entries],
                part.lengths[entries],
                part.residual[first:last],
                1,
            )
        )
    cut = Linearised(parts, whole.image, whole.density, whole.region, whole.bounds, whole.strength)
    assert np.array_equal(settled(cut), settled(whole))

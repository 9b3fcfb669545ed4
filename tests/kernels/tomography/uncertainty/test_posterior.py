"""Samples of the posterior have the mean and covariance of the dense normal equations."""

from unittest.mock import patch

import numpy as np
import pytest
from scipy.sparse import random_array

from bentray_kernels.tomography.finite_frequency import blurred
from bentray_kernels.tomography.gauss_newton import linearisation
from bentray_kernels.tomography.gauss_newton.ray_matrix import RayMatrix
from bentray_kernels.tomography.uncertainty import posterior as module
from bentray_kernels.tomography.uncertainty.posterior import Posterior
from bentray_kernels.tomography.uncertainty.probe_product import LANES, back_projections, normal_products

from ..gauss_newton.test_linear_problem import rows_of

SHAPE, RAYS = (7, 6), 25
NODES = SHAPE[0] * SHAPE[1]


def problem(width):
    """Two parts of rows through an image with an unequal prior; the first node is fixed."""
    random = np.random.default_rng(3)
    parts, weights = [], []
    for rays in (RAYS, 5):
        matrix = random_array((rays, NODES), density=0.3, rng=random, format="csr")
        parts.append(rows_of(matrix, random.standard_normal(rays)))
        weights.append(random.uniform(0.5, 2.0, rays))
    deviation = random.uniform(0.5, 2.0, SHAPE)
    deviation[0, 0] = 0.0
    return Posterior(parts, weights, deviation, 2.0, 0.3 * RAYS, width)


def dense(posterior):
    """The matrix of all rows with blurring and prior root, of the white variables; the map to images."""
    blocks = [
        np.stack([part.project(blurred(unit.reshape(SHAPE), posterior.width)) for unit in np.eye(NODES)], 1)
        for part in posterior.parts
    ]
    root = np.stack(
        [posterior._image(np.tile(one.reshape(SHAPE), (LANES, 1, 1)))[0].ravel() for one in np.eye(NODES)], 1
    )
    scale = np.sqrt(np.concatenate(posterior.weights))[:, None]
    return scale * (np.concatenate(blocks) @ root), root


@pytest.fixture(autouse=True)
def converged():
    with patch.object(module, "MAX_STEPS", 500), patch.object(module, "TOLERANCE", 1e-12):
        yield


@pytest.mark.parametrize("width", [0.0, 0.8])
def test_the_first_probe_is_the_mean_of_the_posterior(width):
    posterior = problem(width)
    matrix, root = dense(posterior)
    noise = [np.repeat(part.residual[:, None], LANES, 1) for part in posterior.parts]
    result = posterior.solutions(noise, np.zeros((LANES, *SHAPE)))
    right = matrix.T @ (np.sqrt(np.concatenate(posterior.weights)) * np.concatenate([n[:, 0] for n in noise]))
    mean = root @ np.linalg.solve(np.eye(NODES) + matrix.T @ matrix, right)
    assert np.allclose(result.reshape(LANES, -1), mean, rtol=1e-7, atol=1e-9)
    assert np.all(result[:, 0, 0] == 0.0)


def test_samples_have_the_covariance_of_the_posterior():
    posterior = problem(0.0)
    matrix, root = dense(posterior)
    random = np.random.default_rng(0)
    samples = []
    for _ in range(120):
        noise = [random.standard_normal((w.size, LANES)) / np.sqrt(w)[:, None] for w in posterior.weights]
        samples.append(posterior.solutions(noise, random.standard_normal((LANES, *SHAPE))))
    result = np.concatenate(samples).reshape(-1, NODES)
    exact = root @ np.linalg.inv(np.eye(NODES) + matrix.T @ matrix) @ root.T
    spread = np.sqrt(np.diag(exact))[1:]
    # 960 samples: 2.3 % of a standard deviation.
    assert np.allclose(result.std(axis=0)[1:], spread, rtol=0.12)
    correlation = np.corrcoef(result[:, 1:].T) - exact[1:, 1:] / np.outer(spread, spread)
    assert np.abs(correlation).max() < 0.17


def test_the_prior_has_unit_variance_away_from_the_rim():
    _, root = dense(problem(0.0))
    flat = root[1:] / np.where(
        problem(0.0).deviation.ravel()[1:, None] > 0, problem(0.0).deviation.ravel()[1:, None], 1
    )
    assert (flat**2).sum(axis=1).mean() == pytest.approx(1.0, rel=0.1)


def test_threads_do_not_change_the_bits():
    posterior = problem(0.0)
    noise = [np.ones((w.size, LANES)) for w in posterior.weights]
    alone = posterior.solutions(noise, np.ones((LANES, *SHAPE)))
    with patch.object(linearisation, "MIN_ENTRIES", 0):
        assert np.array_equal(posterior.solutions(noise, np.ones((LANES, *SHAPE))), alone)


def test_products_equal_those_of_the_dense_matrix():
    random = np.random.default_rng(1)
    matrix = random_array((30, 50), density=0.2, rng=random, format="csr")
    lengths = matrix.data.astype(np.float32)
    dense = matrix.toarray().astype(np.float32).astype(float)
    rows = RayMatrix(matrix.indptr.astype(np.int64), matrix.indices.astype(np.int32), lengths)
    weights = random.uniform(0.5, 2.0, 30)
    probes, begun = random.standard_normal((50, LANES)), random.standard_normal((50, LANES))
    into = begun.copy()
    normal_products(rows, weights, probes, into)
    assert np.allclose(into, begun + dense.T @ (weights[:, None] * (dense @ probes)), rtol=1e-12)
    values, into = random.standard_normal((30, LANES)), begun.copy()
    back_projections(rows, values, into)
    assert np.allclose(into, begun + dense.T @ values, rtol=1e-12)

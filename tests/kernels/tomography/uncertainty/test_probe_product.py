"""Products of the rays' matrix with several probes are those of the dense matrix."""

import numpy as np
from scipy.sparse import random_array

from bentray_kernels.tomography.uncertainty.probe_product import LANES, back_projections, normal_products


def test_products_equal_those_of_the_dense_matrix():
    random = np.random.default_rng(1)
    matrix = random_array((30, 50), density=0.2, rng=random, format="csr")
    lengths = matrix.data.astype(np.float32)
    dense = matrix.toarray().astype(np.float32).astype(float)
    rows = matrix.indptr.astype(np.int64), matrix.indices.astype(np.int32), lengths
    weights = random.uniform(0.5, 2.0, 30)
    probes, begun = random.standard_normal((50, LANES)), random.standard_normal((50, LANES))
    into = begun.copy()
    normal_products(*rows, weights, probes, into)
    assert np.allclose(into, begun + dense.T @ (weights[:, None] * (dense @ probes)), rtol=1e-12)
    values, into = random.standard_normal((30, LANES)), begun.copy()
    back_projections(*rows, values, into)
    assert np.allclose(into, begun + dense.T @ values, rtol=1e-12)

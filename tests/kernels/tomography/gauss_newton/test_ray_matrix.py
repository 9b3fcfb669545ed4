"""Products with the rays' matrix: adjoint to rounding, equal to the dense ones."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import random_array

from bentray_kernels.tomography.gauss_newton.ray_matrix import back_project, normal_product, project

from ....effort import effort


@given(rows=st.integers(1, 30), nodes=st.integers(1, 40), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=effort(20, 40), deadline=None)
def test_products_are_those_of_the_dense_matrix(rows, nodes, seed):
    rng = np.random.default_rng(seed)
    sparse = random_array((rows, nodes), density=0.3, format="csr", dtype=np.float32, rng=rng)
    dense = sparse.toarray().astype(float)
    parts = sparse.indptr.astype(np.int64), sparse.indices.astype(np.int32), sparse.data
    image, values = rng.normal(size=nodes), rng.normal(size=rows)
    back, normal = np.ones((2, nodes))
    back_project(*parts, values, back)
    assert np.allclose(back - 1.0, dense.T @ values, atol=1e-12)
    # Adjointness: ⟨A·image, values⟩ = ⟨image, Aᵀ·values⟩.
    there, again = (dense @ image) @ values, image @ (back - 1.0)
    assert abs(there - again) <= 1e-12 * (1.0 + abs(there))
    weights = rng.uniform(size=rows)
    normal_product(*parts, weights, image, normal)
    assert np.allclose(normal - 1.0, dense.T @ (weights * (dense @ image)), atol=1e-12)
    along = np.empty(rows)
    project(*parts, image, along)
    assert np.allclose(along, dense @ image, atol=1e-12)

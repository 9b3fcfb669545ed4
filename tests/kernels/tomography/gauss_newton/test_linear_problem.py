"""The linear problem: the minimum that each penalty must have, its differences and products, its bits."""

import itertools
import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array, diags_array, eye_array, kron, random_array

from bentray_kernels.tomography.gauss_newton import linear_problem, linearisation
from bentray_kernels.tomography.gauss_newton.linear_problem import Linearised, smoothing
from bentray_kernels.tomography.gauss_newton.linearisation import Rows
from bentray_kernels.tomography.gauss_newton.penalties import adjoint, gradient, laplacian, shrink
from bentray_kernels.tomography.gauss_newton.ray_matrix import (
    RayMatrix,
    back_project,
    normal_product,
    project,
)

from ....effort import effort


def rows_of(matrix, residual, counts=None):
    """Rows of a matrix with their residuals, of one emitter unless their numbers are given."""
    sparse = csr_array(matrix)
    pointers, columns = sparse.indptr.astype(np.int64), sparse.indices.astype(np.int32)
    counts = [len(residual)] if counts is None else counts
    return Rows(
        pointers, columns, sparse.data.astype(np.float32), np.asarray(residual, float), np.array(counts)
    )


def rays(rows, nodes):
    return random_array((rows, nodes), density=0.1, dtype=np.float32, rng=np.random.default_rng(5))


def problem(strength, truth, *, rows=400, bounds=(-9.0, 9.0), region=None, start=0.0, wrong=0, **more):
    region = np.ones(truth.shape, dtype=bool) if region is None else region
    matrix = rays(rows, truth.size)
    image = np.full(truth.shape, start)
    residual = matrix @ (truth - image).ravel()
    residual[:wrong] += 5.0
    density = float(matrix.sum() / region.sum())
    return Linearised([rows_of(matrix, residual)], image, density, region, bounds, strength, **more)


def settled(linearised):
    """The solution after several calls, each from the dual variable of the last."""
    dual = np.zeros((linearised.image.ndim, *linearised.image.shape))
    for _ in range(20):
        image, dual = linearised.solve(dual)
    return image


TRUTH = np.where(np.hypot(*(np.indices((12, 12)) - 5.5)) < 4.0, 1.0, 0.0)
BALL = np.where(np.sqrt(((np.indices((6, 7, 5)) - 2.5) ** 2).sum(axis=0)) < 2.0, 1.0, 0.0)


@pytest.mark.parametrize("truth", [TRUTH, BALL], ids=["2-D", "3-D"])
def test_without_a_penalty_exact_data_give_the_truth(truth):
    assert np.abs(settled(problem(0.0, truth)) - truth).max() < 0.05


@pytest.mark.parametrize(("truth", "rows"), [(TRUTH, 70), (BALL, 120)], ids=["2-D", "3-D"])
def test_few_data_suffice_for_few_edges(truth, rows):
    """Fewer rays than nodes: least squares cannot know, total variation does."""
    blurred = settled(problem(0.0, truth, rows=rows))
    sharp = settled(problem(0.01, truth, rows=rows))
    assert np.abs(sharp - truth).mean() < 0.7 * np.abs(blurred - truth).mean()


@pytest.mark.parametrize("truth", [TRUTH, BALL], ids=["2-D", "3-D"])
def test_strong_total_variation_removes_edges(truth):
    image = settled(problem(1e3, truth))
    assert np.ptp(image) < 1e-3


def reweighted(edge, strength=0.05):
    """Few data, the image of each solution being where the next one begins, as in Gauss–Newton."""
    asked = problem(strength, TRUTH, rows=70, edge=edge)
    matrix, dual = rays(70, TRUTH.size), np.zeros((2, *TRUTH.shape))
    for _ in range(20):
        image, dual = asked.solve(dual)
        left = matrix @ (TRUTH - image).ravel()
        asked = replace(asked, image=image, parts=[rows_of(matrix, left)])
    return asked.image


def test_edges_keep_their_contrast_with_a_concave_penalty():
    flattened, kept = reweighted(np.inf), reweighted(0.05)
    assert np.abs(kept - TRUTH).mean() < 0.4 * np.abs(flattened - TRUTH).mean()


def test_an_image_without_slopes_gets_plain_total_variation():
    dual = np.zeros((2, *TRUTH.shape))
    plain, _ = problem(0.05, TRUTH).solve(dual)
    flat, _ = problem(0.05, TRUTH, edge=0.1).solve(dual)
    assert np.array_equal(plain, flat)


@pytest.mark.parametrize("edge", [np.inf, 2.0, 0.25, 0.05])
def test_an_edge_loses_the_height_that_its_logarithm_costs(edge):
    """Two plateaus, seen node by node. Each moves towards the other by the weight of the edge over its width.

    Σ ½(u − data)² + weight·|step of u|, summed over a plateau: width·(u − data) = ±weight; the weight is the
    slope of strength·edge·log(1 + |step|/edge), strength/(1 + |step|/edge).
    """
    width, strength, step = 3, 0.6, 1.0
    plateaus = np.repeat([0.0, step], width)[:, None] * np.ones(4)
    seen = rows_of(eye_array(plateaus.size, dtype=np.float32), np.zeros(plateaus.size))
    asked = Linearised([seen], plateaus, 1.0, np.ones(plateaus.shape, bool), (-9.0, 9.0), strength, edge=edge)
    lost = strength / (1.0 + step / edge) / width
    expected = np.repeat([lost, step - lost], width)[:, None] * np.ones(4)
    assert np.abs(settled(asked) - expected).max() < 0.02 * lost


def second_differences(shape):
    """Second differences of an image of two axes, as a matrix."""

    def along(n):
        forward = diags_array([-np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))
        return forward.T @ forward

    return -(kron(along(shape[0]), eye_array(shape[1])) + kron(eye_array(shape[0]), along(shape[1])))


@pytest.mark.parametrize("penalty", ["laplacian", "tikhonov"])
def test_quadratic_penalties_reach_the_minimum_of_the_normal_equations(penalty):
    strength, centre = 0.3, np.full(TRUTH.shape, 0.25)
    asked = problem(strength, TRUTH, rows=70, penalty=penalty, start=0.1, reference=centre)
    matrix = rays(70, TRUTH.size).toarray().astype(float)
    stiff = np.eye(TRUTH.size)
    if penalty == "laplacian":
        differences = second_differences(TRUTH.shape).toarray()
        stiff, centre = differences @ differences, np.zeros_like(centre)
    left = matrix.T @ matrix / asked.density + strength * stiff
    right = matrix.T @ (matrix @ TRUTH.ravel()) / asked.density + strength * stiff @ centre.ravel()
    image, _ = asked.solve(np.zeros((2, *TRUTH.shape)))
    assert np.abs(image.ravel() - np.linalg.solve(left, right)).max() < 1e-3


def lines(nodes):
    """Rays from all sides through a square image, as a matrix: a node long in each node that they pass."""
    steps = np.arange(nodes) - 0.5 * (nodes - 1)
    angles = np.linspace(0.0, np.pi, 2 * nodes, endpoint=False)
    angle, offset = (part.ravel()[:, None] for part in np.meshgrid(angles, steps, indexing="ij"))
    # The nearest node of each step along the line; outside the image there is nothing.
    x, y = (
        np.rint(across * offset + along * steps + 0.5 * (nodes - 1)).astype(int)
        for across, along in ((-np.sin(angle), np.cos(angle)), (np.cos(angle), np.sin(angle)))
    )
    met = (x >= 0) & (x < nodes) & (y >= 0) & (y < nodes)
    row = np.broadcast_to(np.arange(offset.size)[:, None], met.shape)
    return csr_array(
        (np.ones(met.sum(), np.float32), (row[met], (nodes * x + y)[met])), (offset.size, nodes**2)
    )


@pytest.mark.parametrize("periods", [2, 4])
@pytest.mark.parametrize("nodes", [32, 64])
def test_smoothing_takes_half_of_its_wavelength_whatever_the_grid(nodes, periods):
    """Shorter waves are lost, longer ones stay: the data's curvature is that of rays from all sides."""
    matrix, region = lines(nodes), np.ones((nodes, nodes), dtype=bool)
    density, wavenumber = float(matrix.sum() / nodes**2), 2.0 * np.pi * periods / nodes

    def left(part):
        wave = np.cos(part * wavenumber * np.arange(nodes))[:, None] * np.ones(nodes)
        residual = matrix @ wave.ravel()
        asked = Linearised(
            [rows_of(matrix, residual)],
            np.zeros_like(wave),
            density,
            region,
            (-9.0, 9.0),
            smoothing(wavenumber),
            "laplacian",
        )
        image, _ = asked.solve(np.zeros((2, nodes, nodes)))
        middle = slice(nodes // 4, -nodes // 4)
        return (image * wave)[middle, middle].sum() / (wave**2)[middle, middle].sum()

    assert left(1.0) == pytest.approx(0.5, abs=0.15)
    assert left(0.5) > 0.85
    assert left(2.0) < 0.15


def test_without_a_reference_tikhonov_stays_near_the_image():
    image, _ = problem(1e6, TRUTH, penalty="tikhonov", start=0.3).solve(np.zeros((2, *TRUTH.shape)))
    assert np.abs(image - 0.3).max() < 1e-3


@pytest.mark.parametrize(("penalty", "strength"), [("total-variation", 0.01), ("laplacian", 1e-4)])
def test_rows_far_off_count_less(penalty, strength):
    plain = settled(problem(strength, TRUTH, wrong=8, penalty=penalty))
    robust = settled(problem(strength, TRUTH, wrong=8, penalty=penalty, huber=0.5))
    assert np.abs(robust - TRUTH).mean() < 0.5 * np.abs(plain - TRUTH).mean()


@pytest.mark.parametrize("penalty", ["total-variation", "laplacian"])
def test_large_huber_scale_equals_least_squares(penalty):
    plain, _ = problem(0.01, TRUTH, penalty=penalty).solve(np.zeros((2, *TRUTH.shape)))
    robust, _ = problem(0.01, TRUTH, penalty=penalty, huber=100.0).solve(np.zeros((2, *TRUTH.shape)))
    assert np.abs(plain - robust).max() < 1e-3


@pytest.mark.parametrize("penalty", ["total-variation", "laplacian", "tikhonov"])
def test_bounds_and_region_hold(penalty):
    region = np.zeros((12, 12), dtype=bool)
    region[2:10, 2:10] = True
    image = settled(problem(0.01, TRUTH, bounds=(0.1, 0.7), region=region, start=0.2, penalty=penalty))
    assert (image[~region] == 0.2).all()
    assert image.min() >= 0.1
    assert image.max() <= 0.7


@pytest.mark.parametrize("penalty", ["total-variation", "laplacian"])
def test_two_threads_give_the_bits_of_one(penalty, monkeypatch):
    asked = problem(0.05, TRUTH, rows=31, penalty=penalty, huber=0.5)
    dual = np.zeros((2, *TRUTH.shape))
    alone, alone_dual = asked.solve(dual)
    names, curvature = set(), linear_problem._curvature

    def seen(*args):
        names.add(threading.current_thread().name)
        return curvature(*args)

    monkeypatch.setattr(linear_problem, "_curvature", seen)
    monkeypatch.setattr(linearisation, "MIN_ENTRIES", 0)
    both, both_dual = asked.solve(dual)
    assert names
    assert threading.current_thread().name not in names
    np.testing.assert_array_equal(both, alone)
    np.testing.assert_array_equal(both_dual, alone_dual)


@pytest.mark.parametrize("penalty", ["total-variation", "laplacian"])
@pytest.mark.parametrize("cuts", [1, 3])
def test_parts_of_the_rows_give_the_bits_of_the_whole(cuts, penalty):
    whole = problem(0.05, TRUTH, rows=30, penalty=penalty, huber=0.5)
    part = whole.parts[0]
    ends = [0, *np.linspace(0, 30, cuts + 1).astype(int)[1:]]
    parts = [part.between(first, last) for first, last in itertools.pairwise(ends)]
    cut = Linearised(
        parts,
        whole.image,
        whole.density,
        whole.region,
        whole.bounds,
        whole.strength,
        penalty=penalty,
        huber=0.5,
    )
    assert np.array_equal(settled(cut), settled(whole))


def test_no_rays_leave_the_image_as_it_is():
    asked = problem(0.1, TRUTH)
    silent = Linearised([], asked.image, 0.0, asked.region, asked.bounds, 0.1)
    image, _ = silent.solve(np.zeros((2, *TRUTH.shape)))
    assert np.array_equal(image, asked.image)


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


@given(rows=st.integers(1, 30), nodes=st.integers(1, 40), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=effort(20, 40), deadline=None)
def test_products_are_those_of_the_dense_matrix(rows, nodes, seed):
    rng = np.random.default_rng(seed)
    sparse = random_array((rows, nodes), density=0.3, format="csr", dtype=np.float32, rng=rng)
    dense = sparse.toarray().astype(float)
    matrix = RayMatrix(sparse.indptr.astype(np.int64), sparse.indices.astype(np.int32), sparse.data)
    image, values = rng.normal(size=nodes), rng.normal(size=rows)
    back, normal = np.ones((2, nodes))
    back_project(matrix, values, back)
    assert np.allclose(back - 1.0, dense.T @ values, atol=1e-12)
    # Adjointness: ⟨A·image, values⟩ = ⟨image, Aᵀ·values⟩.
    there, again = (dense @ image) @ values, image @ (back - 1.0)
    assert abs(there - again) <= 1e-12 * (1.0 + abs(there))
    weights = rng.uniform(size=rows)
    normal_product(matrix, weights, image, normal)
    assert np.allclose(normal - 1.0, dense.T @ (weights * (dense @ image)), atol=1e-12)
    along = np.empty(rows)
    project(matrix, image, along)
    assert np.allclose(along, dense @ image, atol=1e-12)

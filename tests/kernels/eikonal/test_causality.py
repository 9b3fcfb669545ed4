"""Causality, which every method claims, and how the default solver repairs nodes out of order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from bentray_kernels import eikonal
from bentray_kernels.eikonal import accurate
from bentray_kernels.eikonal.problem import PointSource
from bentray_kernels.eikonal.updates import Front, factored_update

from ...effort import effort

SEEDS = st.integers(0, 2**32 - 1)
CONTRASTS = st.floats(np.log10(1.5), 4.0).map(lambda decades: 10.0**decades)

# Second differences can make a wave look this much faster: a plain update is at least the first-order one of
# a medium whose slowness is two thirds. The factored ones take nothing sooner than the highest speed allows.
PLAIN_SECOND_ORDER = 2.0 / 3.0


def rough_problem(seed, contrast, ndim):
    """Speeds of that contrast without any smoothness, and a source where nodes tie or do not."""
    rng = np.random.default_rng(seed)
    shape = rng.integers(2, 13 if ndim == 2 else 8, ndim)
    decades = (rng.uniform(-0.5, 0.5, shape), rng.integers(0, 2, shape) - 0.5)[rng.integers(2)]
    last = shape - 1
    position = rng.random(ndim) * last
    axis = rng.integers(ndim)
    on_face = np.where(np.arange(ndim) == axis, last * rng.integers(0, 2), position)
    in_the_middle = np.minimum(np.floor(position) + 0.5, last)
    corner = last * rng.integers(0, 2, ndim)
    return contrast**decades, (position, on_face, in_the_middle, np.round(position), corner)[rng.integers(5)]


def assert_causal(speed, source, method):
    tof = eikonal.solve(speed, 1.0, source, method)
    assert np.isfinite(tof).all()
    away = np.abs(np.indices(tof.shape) - np.reshape(source, (-1,) + (1,) * tof.ndim))
    outside = (away >= 1.0 - 1e-9).any(axis=0)
    padded = np.pad(tof, 1, constant_values=np.inf)
    inside = (slice(1, -1),) * tof.ndim
    earliest = np.minimum.reduce(
        [np.roll(padded, step, axis)[inside] for axis in range(tof.ndim) for step in (1, -1)]
    )
    assert (earliest <= tof)[outside].all()
    chosen = eikonal.METHODS[method]
    share = 1.0 if chosen.differences == 1 or chosen.factored else PLAIN_SECOND_ORDER
    soonest = share * np.sqrt((away**2).sum(axis=0)) / speed.max()
    assert (tof >= soonest * (1.0 - 1e-9)).all()


@given(seed=SEEDS, contrast=CONTRASTS)
@settings(max_examples=effort(20, 5_000), deadline=None)
def test_rough_models_give_causal_times(method, ndim, seed, contrast):
    assert_causal(*rough_problem(seed, contrast, ndim), method)


@pytest.mark.parametrize("seed", [1222, 1655, 1682, 1864])
def test_a_node_settled_too_soon_is_settled_again(seed):
    speed = np.random.default_rng(seed).uniform(0.2, 5.0, (5, 6, 4))
    assert_causal(speed, (0, 0, 0), "accurate")
    marched = eikonal.solve(speed, 1.0, (0, 0, 0), "hafmm")
    assert np.allclose(eikonal.solve(speed, 1.0, (0, 0, 0)), marched, rtol=1e-12, atol=0.0)


def test_second_differences_beside_a_kink_are_no_faster_than_a_wave():
    """The source lies next to a fast node; its own slowness is that of the slow one across the cell."""
    speed = 1.0 / np.repeat([[10.83], [0.0923]], 4, axis=1)
    for method in ("accurate", "hafmm"):
        assert_causal(speed, (0.964, 0.0), method)


@pytest.mark.parametrize("window", [2, 20, 10_000])
def test_the_order_hardly_matters(monkeypatch, ndim, window):
    """Shuffled over so many places; altogether it is left to the heap."""
    shape = (24, 20) if ndim == 2 else (9, 8, 10)
    decades = gaussian_filter(np.random.default_rng(7).normal(size=shape), 2.0)
    speed = 2.0 ** (decades / np.abs(decades).max())
    source = np.array([3.3, 4.0, 5.5])[:ndim]
    by_arrival = accurate._by_arrival

    def shuffled(time, count):
        late = np.random.default_rng(8).uniform(0.0, window, count)
        return by_arrival(time, count)[np.argsort(np.arange(count) + late)]

    monkeypatch.setattr(accurate, "_by_arrival", shuffled)
    assert_causal(speed, source, "accurate")
    marched = eikonal.solve(speed, 1.0, source, "hafmm")
    # A node that nearly ties with a neighbour may take its time from it or not: second-order size.
    close = 5e-3 if window < speed.size else 1e-12
    assert np.allclose(eikonal.solve(speed, 1.0, source), marched, rtol=close, atol=0.0)


def solved(problem, order):
    """Padded times of a pass in an order, s, and whether it was completed."""
    return accurate._pass(order.astype(np.int32), problem.start(), problem.strides, problem.factor())


def recomputed(problem, times):
    """Every time computed again from the earlier ones alone; those of the source's cell as they are."""
    squares, limit, least = problem.factor()
    steps = (*problem.strides, 0)[:3]
    again = times.copy()
    seeds = set(problem.seeds()[0].tolist())
    tau = np.ones_like(times)
    finite = np.isfinite(times) & (squares > 0.0)
    tau[finite] = times[finite] / np.sqrt(squares[finite])
    for node in np.flatnonzero(np.isfinite(times)):
        if node not in seeds:
            settled = np.where(times < times[node] * (1.0 - 1e-12), times, np.inf)
            front = Front(
                steps, problem.spacing, problem.padded_slowness, squares, limit, least, tau, settled
            )
            again[node] = factored_update(int(node), front)
    return again


def problem_of(rng, ndim, contrast):
    shape = (12, 10) if ndim == 2 else (5, 6, 4)
    speed = contrast ** rng.uniform(-0.5, 0.5, shape)
    return PointSource.checked(speed, 1.0, rng.uniform(0.0, 1.0, ndim) * (np.array(shape) - 1))


@pytest.mark.parametrize("ndim", [2, 3])
@given(seed=SEEDS, window=st.sampled_from([0.0, 1.0, 4.0, 30.0]), contrast=st.sampled_from([1.5, 4.0, 20.0]))
@settings(max_examples=25, deadline=None)
def test_each_time_follows_from_the_earlier_ones_in_whatever_order_nodes_come(ndim, seed, window, contrast):
    rng = np.random.default_rng(seed)
    problem = problem_of(rng, ndim, contrast)
    best = np.pad(eikonal.solve(1.0 / problem.slowness, 1.0, problem.source, "fmm", order=1), 1).ravel()
    inside = np.flatnonzero(np.pad(np.ones(problem.slowness.shape, bool), 1))
    order = inside[np.argsort(best[inside])]
    order = order[np.argsort(np.arange(order.size) + rng.uniform(0.0, window, order.size))]
    times, complete = solved(problem, order)
    if not complete:
        assert window > 0.0
        return
    assert np.isfinite(times[inside]).all()
    again = recomputed(problem, times)
    assert np.allclose(again[inside], times[inside], rtol=1e-9, atol=0.0)


@given(seed=SEEDS, size=st.integers(1, 60), ties=st.booleans())
def test_the_order_of_arrival_is_that_of_a_stable_sort(seed, size, ties):
    rng = np.random.default_rng(seed)
    times = rng.uniform(0.0, 3.0, size) ** 4
    if ties:
        times = np.floor(times)
    padded = np.concatenate([[np.inf], times, [np.inf, np.inf]])
    order = accurate._by_arrival(padded, size)
    assert order.tolist() == np.argsort(padded, kind="stable")[:size].tolist()


@pytest.mark.parametrize("ndim", [2, 3])
def test_supersampling_brings_the_time_nearer_the_exact_one(ndim):
    """The error of second order falls to about a quarter on a grid twice as fine; the medium is even."""
    n, source = (33, (0.31, 0.42)) if ndim == 2 else (13, (0.31, 0.42, 0.53))

    def times(refinement, supersample):
        axes = np.meshgrid(*[np.linspace(0.0, np.pi, refinement * (n - 1) + 1)] * ndim, indexing="ij")
        speed = 1.0 / (1.0 + 0.3 * np.prod(np.cos(axes), axis=0))
        tof = eikonal.solve(speed, 1.0 / refinement / (n - 1), source, supersample=supersample)
        return tof[(slice(None, None, refinement),) * ndim]

    truth = times(4, 2)
    plain, fine = (np.abs(times(1, supersample) - truth).mean() for supersample in (1, 2))
    assert 0.1 * plain < fine < 0.4 * plain


def test_the_finer_medium_stays_within_the_range_of_the_medium():
    """A cubic spline overshoots beside a step."""
    speed = np.full((12, 12), 1500.0)
    speed[6:] = 1800.0
    problem = PointSource.checked(speed, 1e-3, (0.002, 0.005))
    fine = accurate._supersampled(problem, 3).slowness
    assert fine.shape == (34, 34)
    assert fine.min() == problem.slowness.min()
    assert fine.max() == problem.slowness.max()

"""Marches that stop at receivers: what they accepted is what the full march gives, and it is enough."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.errors import InvalidInput

METHODS = [name for name, m in eikonal.METHODS.by_name.items() if "stop_at" in m.options()]
PLACES = st.lists(st.tuples(*[st.floats(0.0, 1.0)] * 3), min_size=1, max_size=5)


def taken(point, last):
    """The corners of a point's cell and their neighbours along the axes, clipped to the grid."""
    low = np.minimum(point.astype(int), last)
    for corner in np.ndindex(*(2,) * len(last)):
        node = np.minimum(low + corner, last)
        for step in np.vstack(
            (np.zeros_like(last), np.eye(len(last), dtype=int), -np.eye(len(last), dtype=int))
        ):
            yield tuple(np.clip(node + step, 0, last))


def test_marching_methods_can_stop():
    assert METHODS == ["fmm", "hafmm", "fmm-untidy"]


@pytest.mark.parametrize("method", METHODS)
@given(
    seed=st.integers(0, 2**32 - 1), source=PLACES, receivers=PLACES, flat=st.booleans(), snap=st.booleans()
)
@settings(max_examples=40, deadline=None)
def test_accepted_times_are_those_of_the_full_march(method, seed, source, receivers, flat, snap):
    shape = (13, 16) if flat else (7, 6, 8)
    last = np.array(shape) - 1
    speed = 10.0 ** np.random.default_rng(seed).uniform(-1.0, 1.0, shape)
    points = np.array(receivers)[:, : len(shape)] * last
    if snap:
        points = np.round(points)
    for options in ({},) if method == "hafmm" else ({}, {"order": 1}):
        place = np.array(source[0][: len(shape)]) * last
        full = eikonal.solve(speed, 1.0, place, method, **options)
        part = eikonal.solve(speed, 1.0, place, method, stop_at=points, **options)
        reached = np.isfinite(part)
        assert np.array_equal(part[reached], full[reached])
        assert np.all(part[~reached] == np.inf)
        # All that a multilinear time and a multilinear gradient from central differences take.
        assert all(reached[node] for point in points for node in taken(point, last))


@pytest.mark.parametrize("method", METHODS)
def test_near_receivers_leave_most_of_the_grid_alone(method):
    part = eikonal.solve(np.ones((41, 41)), 0.1, (2.0, 2.0), method, stop_at=[(2.3, 2.1), (1.8, 1.9)])
    assert np.isfinite(part[18:24, 18:23]).all()
    assert np.isfinite(part).mean() < 0.1


@pytest.mark.parametrize("method", METHODS)
def test_a_receiver_beside_a_node_waits_for_the_cells_on_both_sides(method):
    for place in (1.0 - 1e-12, 1.0, 1.0 + 1e-12):
        part = eikonal.solve(np.ones((30, 3)), 0.1, (0.0, 0.1), method, stop_at=[(place, 0.1)])
        assert np.isfinite(part[:13]).all()
        assert not np.isfinite(part[15:]).any()


@pytest.mark.parametrize("method", METHODS)
def test_many_stop_at_the_same_points(method):
    speeds = np.random.default_rng(5).uniform(0.5, 2.0, (3, 20, 20))
    sources, points = [[0.3, 0.4], [1.0, 1.0], [0.2, 1.7]], [[0.5, 0.5], [1.0, 0.2]]
    many = eikonal.solve_many(speeds, 0.1, sources, method, threads=2, stop_at=points)
    for speed, source, tof in zip(speeds, sources, many, strict=True):
        assert np.array_equal(tof, eikonal.solve(speed, 0.1, source, method, stop_at=points))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([(0.5, 0.5), (0.5, 1.2)], "[0.5, 1.2] at 1"),
        ([(-0.1, 0.5)], "points in the grid, 0 to [1.0, 1.0] m"),
        ([(0.5, float("nan"))], "points in the grid"),
        ((0.5, 0.5), "found shape (2,)"),
        ([(0.5, 0.5, 0.5)], "(k, 2) coordinates"),
        (np.empty((0, 2)), "k >= 1"),
    ],
)
def test_points_that_are_not_in_the_grid_are_refused(method, points, words):
    with pytest.raises(InvalidInput) as refusal:
        eikonal.solve(np.ones((11, 11)), 0.1, (0.5, 0.5), method, stop_at=points)
    assert refusal.value.field == "stop_at"
    assert words in str(refusal.value)

"""Every bound holds every value of every cell, for every filter; the closer ones are closer."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.isosurface import BOUNDS, cell_ranges
from bentray_kernels.splines import FILTERS, Spline

from ...effort import effort

SHAPE = (4, 3, 5)


def dense(per_cell: int) -> np.ndarray:
    """Cells (c, 3) of SHAPE and points in each, faces, edges and nodes included, (c, points, 3)."""
    cells = np.array(list(np.ndindex(*(n - 1 for n in SHAPE))))
    steps = np.linspace(0.0, 1.0, per_cell)
    inside = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    return cells[:, None] + inside


def test_no_bound_loses_a_value():
    @given(seed=st.integers(0, 2**32 - 1), whole=st.booleans(), name=st.sampled_from(sorted(FILTERS)))
    @settings(max_examples=effort(20, 60), deadline=None)
    def holds(seed, whole, name):
        random = np.random.default_rng(seed)
        nodes = random.normal(100.0, 40.0, SHAPE)
        spline = Spline.from_volume(np.round(nodes) if whole else nodes, name, prefilter=False)
        points = dense(7)
        values = spline.value(points.reshape(-1, 3)).reshape(points.shape[:2])
        isos = random.normal(100.0, 40.0, 2)
        for bound in BOUNDS:
            ranges = cell_ranges(spline, isos, bound)
            assert (ranges.low.ravel() <= values.min(axis=1)).all(), bound
            assert (ranges.high.ravel() >= values.max(axis=1)).all(), bound

    holds()


@pytest.mark.parametrize("name", sorted(FILTERS))
def test_the_exact_range_is_attained(name):
    nodes = np.random.default_rng(3).normal(0.0, 1.0, SHAPE)
    spline = Spline.from_volume(nodes, name, prefilter=False)
    # Iso-values this dense make every cell a candidate.
    ranges = cell_ranges(spline, np.linspace(-4.0, 4.0, 2001), "ccc")
    points = dense(25)
    values = spline.value(points.reshape(-1, 3)).reshape(points.shape[:2])
    np.testing.assert_allclose(ranges.low.ravel(), values.min(axis=1), atol=0.01)
    np.testing.assert_allclose(ranges.high.ravel(), values.max(axis=1), atol=0.01)


@pytest.mark.parametrize("name", sorted(FILTERS))
def test_the_bend_bounds_second_differences_along_lines(name):
    random = np.random.default_rng(4)
    spline = Spline.from_volume(random.normal(0.0, 1.0, SHAPE), name, prefilter=False)
    ranges = cell_ranges(spline, np.linspace(-6.0, 6.0, 4001), "bmcc")
    cells = np.array(list(np.ndindex(*(n - 1 for n in SHAPE))))
    for cell in cells:
        ends = cell + random.random((2, 200, 3))
        length = np.linalg.norm(ends[1] - ends[0], axis=1)
        first, middle, last = (spline.value(p) for p in (ends[0], ends.mean(axis=0), ends[1]))
        bends = np.abs(first - 2.0 * middle + last) / (0.5 * length) ** 2
        assert bends.max() <= ranges.bend[tuple(cell)]
        assert bends.max() >= 0.01 * ranges.bend[tuple(cell)]


@pytest.mark.parametrize(("name", "published"), [("bspline2", 0.671), ("bspline3", 0.375)])
def test_the_sphere_of_table_3(name, published):
    axis = np.arange(64) - 31.5
    radius = np.sqrt(axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2)
    nodes = np.round(255.0 * np.exp(-(np.maximum(radius - 20.0, 0.0) ** 2) / 8.0))
    spline = Spline.from_volume(nodes, name, prefilter=False)
    count = {b: cell_ranges(spline, [128.0], b).candidates(128.0) for b in BOUNDS[:4]}
    assert count["accc"] / count["bmcc"] == pytest.approx(published, abs=0.04)
    assert count["bernstein"] < 0.55 * count["accc"]
    assert count["bernstein"] < count["accc-subcells"] < count["accc"]


def test_a_flat_volume_has_one_value():
    spline = Spline(np.full(SHAPE, 7.0))
    for bound in BOUNDS:
        ranges = cell_ranges(spline, [7.0], bound)
        assert ranges.candidates(7.0) == ranges.low.size
        np.testing.assert_allclose([ranges.low, ranges.high], 7.0, rtol=1e-6)


def test_unknown_bounds_are_rejected():
    with pytest.raises(InvalidInput, match="bound: found tight"):
        cell_ranges(Spline(np.zeros(SHAPE)), [0.0], "tight")

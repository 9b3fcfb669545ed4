"""Bounds of cells hold every value, for every filter; the weights and the octree behind them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import polynomial

from bentray_kernels.errors import InvalidInput
from bentray_kernels.isosurface import BOUNDS, CellRanges, cell_ranges
from bentray_kernels.isosurface.accc import product_ranges, weighted_range
from bentray_kernels.isosurface.cell_weights import CellWeights, cell_weights
from bentray_kernels.isosurface.octree import octree_of
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


def dense_weights(weights: CellWeights, points: np.ndarray) -> np.ndarray:
    """(nodes, places) weights at places of the cell."""
    pieces = len(weights.powers)
    number = np.minimum((points * pieces).astype(int), pieces - 1)
    values = [polynomial.polyval(points * pieces - k, weights.powers[k].T) for k in range(pieces)]
    return np.choose(number, values)


@pytest.mark.parametrize("name", sorted(FILTERS))
@pytest.mark.parametrize("divisions", [1, 2, 3])
def test_the_extremes_of_each_part(name, divisions):
    weights = cell_weights(FILTERS[name])
    low, high = weights.ranges(divisions)
    for part in range(divisions):
        values = dense_weights(weights, np.linspace(part, part + 1, 2001) / divisions)
        np.testing.assert_allclose(low[part], values.min(axis=1), atol=1e-5)
        np.testing.assert_allclose(high[part], values.max(axis=1), atol=1e-5)
        assert (low[part] <= values.min(axis=1) + 1e-15).all()
        assert (high[part] >= values.max(axis=1) - 1e-15).all()


@pytest.mark.parametrize("name", sorted(FILTERS))
def test_the_sum_of_absolute_weights(name):
    weights = cell_weights(FILTERS[name])
    values = dense_weights(weights, np.linspace(0.0, 1.0, 2001))
    np.testing.assert_allclose(values.sum(axis=0), 1.0)
    assert weights.total() == pytest.approx(np.abs(values).sum(axis=0).max(), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "first", "nodes"),
    [
        ("trilinear", 0, 2),
        ("central", 0, 2),
        ("catmull-rom", -1, 4),
        ("bspline2", -1, 4),
        ("bspline3", -1, 4),
    ],
)
def test_the_nodes_that_act_on_a_cell(name, first, nodes):
    weights = cell_weights(FILTERS[name])
    assert (weights.first, weights.nodes) == (first, nodes)


@pytest.mark.parametrize("name", sorted(FILTERS))
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_the_bernstein_form_ends_at_the_weights_and_holds_them(name, derivative):
    weights = cell_weights(FILTERS[name])
    control = weights.control(derivative)
    pieces = len(weights.powers)
    rows = len(control) // pieces
    for k, powers in enumerate(weights.powers):
        derived = polynomial.polyder(powers, derivative, axis=1) * float(pieces) ** derivative
        values = polynomial.polyval(np.linspace(0.0, 1.0, 101), derived.T)
        part = control[k * rows : (k + 1) * rows]
        np.testing.assert_allclose([part[0], part[-1]], [values[:, 0], values[:, -1]], atol=1e-12)
        assert (part.min(axis=0) <= values.min(axis=1) + 1e-12).all()
        assert (part.max(axis=0) >= values.max(axis=1) - 1e-12).all()


def equation_18(nodes: np.ndarray, iso: float, least: np.ndarray, most: np.ndarray) -> tuple[float, float]:
    """Lower and upper bound about one iso-value."""
    apart = nodes - iso
    upper = iso + (apart * np.where(apart >= 0.0, most, least)).sum()
    lower = iso + (apart * np.where(apart >= 0.0, least, most)).sum()
    return lower, upper


@pytest.mark.parametrize("name", ["trilinear", "bspline2", "bspline3", "bspline4"])
def test_the_range_classifies_as_equation_18_does(name):
    weights = cell_weights(FILTERS[name])
    least, most = product_ranges(weights, 1)

    @given(seed=st.integers(0, 2**32 - 1), position=st.floats(-0.2, 1.2))
    @settings(max_examples=effort(20, 200), deadline=None)
    def same(seed, position):
        nodes = np.random.default_rng(seed).normal(0.0, 1.0, weights.nodes**3)
        low, high = weighted_range(nodes, least, most)
        iso = nodes.min() + position * np.ptp(nodes)
        lower, upper = equation_18(nodes, iso, least[0], most[0])
        if min(abs(upper - iso), abs(iso - lower)) > 1e-9:
            assert (low <= iso <= high) == (lower <= iso <= upper)

    same()


def test_parts_of_a_cell_cover_it():
    weights = cell_weights(FILTERS["bspline3"])
    whole, parts = product_ranges(weights, 1), product_ranges(weights, 2)
    assert parts[0].shape == (8, 64)
    np.testing.assert_allclose(parts[0].min(axis=0), whole[0][0])
    np.testing.assert_allclose(parts[1].max(axis=0), whole[1][0])


ISOS = (0.2, 0.5)


def ranges_of(shape: tuple[int, int, int], seed: int) -> CellRanges:
    ends = np.sort(np.random.default_rng(seed).random((2, *shape)) ** 4, axis=0).astype(np.float32)
    return CellRanges(ends[0], ends[1], np.zeros(shape, dtype=np.float32))


@given(shape=st.tuples(*[st.integers(1, 9)] * 3), seed=st.integers(0, 999))
def test_a_node_holds_what_its_cells_hold(shape, seed):
    cells = ranges_of(shape, seed)
    octree = octree_of(cells, ISOS)
    for level, (start, *nodes) in enumerate(octree.levels):
        masks = octree.masks[start : start + np.prod(nodes)].reshape(nodes)
        for node in np.ndindex(*nodes):
            part = tuple(slice(k << level, (k + 1) << level) for k in node)
            for bit, iso in enumerate(ISOS):
                held = ((cells.low[part] <= iso) & (cells.high[part] >= iso)).any()
                assert bool(masks[node] >> bit & 1) == held
    assert octree.levels[-1, 1:].tolist() == [1, 1, 1]


def test_the_box_and_the_highest_empty_level():
    low, high = np.ones((8, 8, 8), dtype=np.float32), np.full((8, 8, 8), 2.0, dtype=np.float32)
    low[2, 3, 5] = low[4, 3, 6] = 0.0
    octree = octree_of(CellRanges(low, high, np.zeros_like(low)), (0.5,))
    np.testing.assert_array_equal(octree.occupied(), [[2, 3, 5], [5, 4, 7]])
    assert octree.highest_empty() == 2
    full = octree_of(CellRanges(low * 0.0, high, np.zeros_like(low)), (0.5,))
    assert full.highest_empty() == 0


def test_more_iso_values_than_bits_are_rejected():
    with pytest.raises(InvalidInput, match="iso: found 9 values"):
        octree_of(ranges_of((2, 2, 2), 0), np.arange(9.0))

"""Crossings along rays: the first one is found, for every filter and by every structure, however grazing."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.isosurface import BOUNDS, cell_ranges, crossing
from bentray_kernels.isosurface.crossing import (
    ANALYTIC,
    BRENT,
    CERTAIN,
    CERTAIN_BRENT,
    MAX_HALVINGS,
    Search,
    leave_interval,
)
from bentray_kernels.isosurface.octree import Octree, octree_of
from bentray_kernels.isosurface.roots import Ray, brent, field_at, first_root_of_cubic, ray_of
from bentray_kernels.splines import Spline
from bentray_kernels.splines.sampler import Sampler, sampler_of

from ...effort import effort

SHAPE = (6, 5, 7)
FILTERS = ("trilinear", "catmull-rom", "bspline2", "bspline3", "bspline6")


@kernel
def leave(
    field: Sampler,
    octree: Octree,
    search: Search,
    origin: tuple[float, float, float],
    along: tuple[float, float, float],
    span: tuple[float, float],
    interval: tuple[float, float],
    slope: float,
    halvings: int,
) -> tuple[float, int, int]:
    ray = ray_of(origin, along)
    s, side, _, left = leave_interval(
        field, octree, search, ray, span[0], span[1], interval[0], interval[1], 255, slope, halvings
    )
    return s, side, left


class Case:
    """A random volume, a ray through its grid from face to face, and the interval of values it starts in."""

    def __init__(self, seed: int, name: str, bound: str = "bernstein") -> None:
        random = np.random.default_rng(seed)
        self.spline = Spline.from_volume(random.normal(0.0, 1.0, SHAPE), name)
        self.isos = np.sort(random.normal(0.0, 0.5, 2))
        self.octree = octree_of(cell_ranges(self.spline, self.isos, bound), self.isos)
        ends = random.random((2, 3)) * (np.array(SHAPE) - 1.0)
        for end in ends:
            axis = random.integers(3)
            end[axis] = random.integers(2) * (SHAPE[axis] - 1.0)
        if random.random() < 0.2:
            ends[1, 1:] = ends[0, 1:]
        self.origin, self.along = ends[0], ends[1] - ends[0]

    def field(self, s: np.ndarray) -> np.ndarray:
        # Kept on the grid: beyond it the class mirrors, where the ray does not go.
        places = self.origin + np.asarray(s)[:, None] * self.along
        return self.spline.value(np.clip(places, 0.0, np.array(SHAPE) - 1.0))

    def interval(self, value: float) -> tuple[float, float]:
        levels = [-np.inf, *self.isos, np.inf]
        layer = int(np.searchsorted(self.isos, value))
        return float(levels[layer]), float(levels[layer + 1])

    def leave(self, search: Search, start: float, interval: tuple[float, float], slope: float = 0.0):
        field = sampler_of(self.spline)
        s, side, left = leave(
            field,
            self.octree,
            search,
            tuple(self.origin),
            tuple(self.along),
            (start, 1.0),
            interval,
            slope,
            MAX_HALVINGS,
        )
        assert left >= 0
        return s, side


def searches(case: Case, name: str) -> list[Search]:
    top = len(case.octree.levels) - 1
    certain = CERTAIN_BRENT if name == "trilinear" else CERTAIN
    kinds = [Search(certain, level, 0.0) for level in (top, 0, 1)]
    return [*kinds, Search(ANALYTIC, top, 0.0)] if name == "trilinear" else kinds


@pytest.mark.parametrize("name", FILTERS)
def test_all_crossings_are_found_and_no_others(name):
    dense = np.linspace(0.0, 1.0, 4001)

    @given(seed=st.integers(0, 2**32 - 1), bound=st.sampled_from(BOUNDS[:4]))
    @settings(max_examples=effort(20, 150), deadline=None)
    def holds(seed, bound):
        case = Case(seed, name, bound)
        values = case.field(dense)
        below, above = case.interval(values[0])
        outside = np.flatnonzero((values < below - 1e-9) | (values > above + 1e-9))
        latest = dense[outside[0]] if len(outside) else np.inf
        for search in searches(case, name):
            s, side = case.leave(search, 0.0, (below, above))
            assert (s if side else np.inf) <= latest
            if side:
                target = above if side > 0 else below
                np.testing.assert_allclose(case.field([s]), target, atol=1e-7)
                before = values[dense < s - 1e-6]
                assert (before >= below - 1e-7).all()
                assert (before <= above + 1e-7).all()

    holds()


@pytest.mark.parametrize("name", ["trilinear", "catmull-rom", "bspline3"])
def test_from_surface_to_surface_all_crossings_are_met(name):
    dense = np.linspace(0.0, 1.0, 20001)

    @given(seed=st.integers(0, 2**32 - 1))
    @settings(max_examples=effort(20, 60), deadline=None)
    def holds(seed):
        case = Case(seed, name)
        values = case.field(dense)
        expected = sum(int((np.diff(np.sign(values - iso)) != 0).sum()) for iso in case.isos)
        levels = [-np.inf, *case.isos, np.inf]
        layer = int(np.searchsorted(case.isos, values[0]))
        s, slope, met = 0.0, 0.0, 0
        while True:
            interval = float(levels[layer]), float(levels[layer + 1])
            s, side = case.leave(searches(case, name)[0], s, interval, slope)
            if side == 0:
                break
            met, layer = met + 1, layer + side
            place = np.clip(case.origin + s * case.along, 0.0, np.array(SHAPE) - 1.0)
            slope = float(case.spline.gradient(place[None])[0] @ case.along)
        # Pairs of crossings between two of the dense samples count in one and not in the other.
        assert met >= expected
        assert (met - expected) % 2 == 0

    holds()


def grazing(peak: float) -> Case:
    """A ray along the crest of 10 − (x − 9.37)²/8, and an iso-value just below it."""
    case = Case(0, "bspline3")
    # The cubic B-spline makes x² + 1/3 of the coefficients k².
    coefficients = 10.0 - 0.125 * ((np.arange(20.0) - 9.37) ** 2 - 1.0 / 3.0)
    case.spline = Spline(coefficients[:, None, None] + np.zeros((1, 4, 4)), prefilter=False)
    case.isos = np.array([10.0 - peak])
    case.octree = octree_of(cell_ranges(case.spline, case.isos, "bernstein"), case.isos)
    case.origin, case.along = np.array([3.0, 1.2, 1.7]), np.array([12.0, 0.0, 0.0])
    return case


@pytest.mark.parametrize("peak", [1e-2, 1e-5, 1e-8])
def test_a_grazing_ray_crosses_twice_within_a_cell(peak):
    case = grazing(peak)
    below, above = -np.inf, float(case.isos[0])
    s, side = case.leave(Search(CERTAIN, 5, 0.0), 0.0, (below, above))
    assert side == 1
    assert 3.0 + 12.0 * s == pytest.approx(9.37 - np.sqrt(8.0 * peak), abs=1e-7)
    slope = float(case.spline.gradient(np.array([[3.0 + 12.0 * s, 1.2, 1.7]]))[0, 0] * 12.0)
    out, back = case.leave(Search(CERTAIN, 5, 0.0), s, (above, np.inf), slope)
    assert back == -1
    assert 3.0 + 12.0 * out == pytest.approx(9.37 + np.sqrt(8.0 * peak), abs=1e-7)
    # What looks at the ends of the cell only sees neither, nor do steps.
    assert case.leave(Search(BRENT, 5, 0.0), 0.0, (below, above))[1] == 0
    if peak < 1e-4:
        assert case.leave(Search(BRENT, 0, 0.1), 0.0, (below, above))[1] == 0


def loosened(octree: Octree) -> Octree:
    """Every cell may hold a surface, so that a ray must prove of each that it does not."""
    masks, bend, levels = octree
    return Octree(np.full_like(masks, 255), np.full_like(bend, bend.max()), levels)


@pytest.mark.parametrize("loose", [False, True])
@pytest.mark.parametrize(("peak", "above"), [(0.3, np.inf), (2.0, np.inf), (2.0, 1.99), (2.0, 0.4)])
def test_a_ray_that_leaves_a_surface_comes_to_the_next_one_cells_away(peak, above, loose):
    """On the crest of ``grazing``, ``peak`` high: down to the same surface, or first up to another one."""
    case = grazing(peak)
    below = float(case.isos[0])
    if np.isfinite(above):
        case.isos = np.array([below, below + above])
        case.octree = octree_of(cell_ranges(case.spline, case.isos, "bernstein"), case.isos)
    if loose:
        case.octree = loosened(case.octree)
    start = (9.37 - np.sqrt(8.0 * peak) - 3.0) / 12.0
    slope = float(case.spline.gradient(np.array([[3.0 + 12.0 * start, 1.2, 1.7]]))[0, 0] * 12.0)
    s, side = case.leave(Search(CERTAIN, 5, 0.0), start, (below, below + above), slope)
    assert side == (1 if np.isfinite(above) else -1)
    expected = 9.37 - np.sqrt(8.0 * (peak - above)) if np.isfinite(above) else 9.37 + np.sqrt(8.0 * peak)
    assert 3.0 + 12.0 * s == pytest.approx(expected, abs=1e-7)


def test_a_ray_that_rises_ever_faster_meets_the_next_surface_in_time():
    """In the valley (x − 9.37)²/8, from 0.5 to 2.4."""
    case = grazing(1.0)
    coefficients = 0.125 * ((np.arange(20.0) - 9.37) ** 2 - 1.0 / 3.0)
    case.spline = Spline(coefficients[:, None, None] + np.zeros((1, 4, 4)), prefilter=False)
    case.isos = np.array([0.5, 2.4])
    case.octree = loosened(octree_of(cell_ranges(case.spline, case.isos, "bernstein"), case.isos))
    start = (11.37 - 3.0) / 12.0
    s, side = case.leave(Search(CERTAIN, 5, 0.0), start, (0.5, 2.4), 0.5 * 12.0)
    assert side == 1
    assert 3.0 + 12.0 * s == pytest.approx(9.37 + np.sqrt(8.0 * 2.4), abs=1e-7)


def test_steps_find_what_lies_between_two_of_them():
    agreed = 0
    for seed in range(20):
        case = Case(seed, "bspline3")
        interval = case.interval(float(case.field([0.0])[0]))
        exact = case.leave(Search(CERTAIN, 3, 0.0), 0.0, interval)
        stepped = case.leave(Search(BRENT, 0, 0.001), 0.0, interval)
        assert exact[1] == stepped[1]
        if exact[1]:
            assert stepped[0] == pytest.approx(exact[0], abs=1e-9)
            agreed += 1
    assert agreed >= 8


@pytest.mark.parametrize("name", ["trilinear", "bspline3"])
def test_a_surface_on_the_face_of_cells_is_left_behind(name):
    # A ramp whose iso-surface is the plane of nodes x = 4: the ray goes on from there and does not stay.
    case = Case(0, name)
    case.spline = Spline.from_volume(np.arange(12.0)[:, None, None] + np.zeros((1, 4, 4)), name)
    case.isos = np.array([4.0, 7.0])
    case.octree = octree_of(cell_ranges(case.spline, case.isos, "bernstein"), case.isos)
    case.origin, case.along = np.array([1.0, 1.3, 1.7]), np.array([9.0, 0.0, 0.0])
    search = searches(case, name)[0]
    first, side = case.leave(search, 0.0, (-np.inf, 4.0))
    assert side == 1
    assert 1.0 + 9.0 * first == pytest.approx(4.0, abs=1e-4)
    for start in (first, (4.0 - 1.0) / 9.0):
        second, side = case.leave(search, start, (4.0, 7.0), 9.0)
        assert side == 1
        assert 1.0 + 9.0 * second == pytest.approx(7.0, abs=1e-4)


def plateau(seed: int) -> Case:
    """A 0/1 volume whose filter leaves ripples about an iso-value of 0 everywhere."""
    case = Case(seed, "bspline3")
    axis = np.arange(24.0) - 11.5
    solid = axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2 < 36.0
    case.spline = Spline(solid.astype(np.uint8))
    case.isos = np.array([0.0])
    case.octree = octree_of(cell_ranges(case.spline, case.isos, "bernstein"), case.isos)
    ends = np.random.default_rng(seed).uniform(0.0, 23.0, (2, 3))
    ends[:, 0] = 0.0, 23.0
    case.origin, case.along = ends[0], ends[1] - ends[0]
    return case


@pytest.mark.parametrize("halvings", [0, 20, MAX_HALVINGS])
def test_a_ray_on_a_plateau_is_given_up_after_so_many_readings(monkeypatch, halvings):
    readings, given_up = [], 0
    read = crossing.field_at
    monkeypatch.setattr(crossing, "field_at", lambda *args: readings.append(1) or read(*args))
    monkeypatch.setattr(crossing, "_scan", crossing._scan.py_func)
    for seed in range(20):
        case = plateau(seed)
        field, ray = sampler_of(case.spline), ray_of(tuple(case.origin), tuple(case.along))
        search, s, side, left = Search(CERTAIN, 5, 0.0), 0.0, 1, halvings
        interval = (-np.inf, 0.0) if float(case.field([0.0])[0]) <= 0.0 else (0.0, np.inf)
        readings.clear()
        calls = 0
        while side != 0 and left >= 0 and calls < 16:
            s, side, _, left = crossing.leave_interval.py_func(
                field, case.octree, search, ray, s, 1.0, *interval, 1, 0.0, left
            )
            interval, calls = ((-np.inf, 0.0) if side < 0 else (0.0, np.inf)), calls + 1
        # Two beside each halving; of cells the ray meets at most 69, and one again in each call.
        assert len(readings) <= 2 * (halvings + 1) + 2 * (69 + calls)
        assert left >= -1
        assert side == 0 or left >= 0
        given_up += left < 0
        # Pieces of the shortest length, of which nothing is proved, use up the halvings sooner.
        assert left >= 0 or len(readings) <= 2 * (69 + calls) + MAX_HALVINGS
    assert given_up >= 5


@kernel
def root(field: Sampler, ray: Ray, target: float, a: float, b: float, tolerance: float) -> float:
    ends = field_at(field, ray, a), field_at(field, ray, b)
    return brent(field, ray, target, a, ends[0], b, ends[1], tolerance)


@kernel
def cubic_root(c0: float, c1: float, c2: float, c3: float) -> float:
    return first_root_of_cubic(c0, c1, c2, c3)


@pytest.mark.parametrize("target", [0.001, 1.0, 7.3, 26.9])
def test_brent_finds_the_place_of_a_value(target):
    # A cubic along x, which the spline reproduces away from its mirrored ends.
    nodes = ((np.arange(80.0) - 38.0) ** 3)[:, None, None] + np.zeros((1, 4, 4))
    spline = Spline(nodes)
    ray = ray_of((38.0, 1.5, 1.5), (2.0, 0.0, 0.0))
    found = root(sampler_of(spline), ray, target, 0.0, 1.5, 1e-12)
    assert 2.0 * found == pytest.approx(np.cbrt(target), abs=1e-8)


coefficient = st.floats(-4.0, 4.0).map(lambda x: round(x, 3))


@given(c=st.tuples(coefficient, coefficient, coefficient, coefficient))
@settings(deadline=None, max_examples=effort(20, 500))
def test_the_first_root_of_a_cubic(c):
    assume(any(c))
    roots = np.roots(c[::-1])
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
    inside = real[(real > 1e-6) & (real < 1.0 - 1e-6)]
    # Roots closer together than rounding can part, or at an end, may fall either way.
    slope = np.polyval(np.polyder(c[::-1]), roots)
    assume(not len(roots) or np.abs(slope).min() > 1e-4)
    assume(all(abs(r) > 1e-6 and abs(r - 1.0) > 1e-6 for r in roots))
    found = cubic_root(*c)
    if len(inside):
        assert found == pytest.approx(inside[0], abs=1e-9)
    else:
        assert np.isinf(found)

"""Outer and inner field: entries of small ones against the exact intersector, samples, batches, agreement."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables.agreement import AGREE, APART, MIXED, NONE, agreement
from bentray_kernels.geometry_field.tables.cube import line_of, number_at, samples
from bentray_kernels.geometry_field.tables.inner_field import build_inner_rows, inner_field, spread_points
from bentray_kernels.geometry_field.tables.outer_field import (
    OuterField,
    boundary_face,
    build_rows,
    outer_field,
)
from bentray_kernels.meshes.surface import surface_of

from ...meshes.test_intersector import by_brute_force, first_faces
from ..shapes import ball, dented, field_of, inner_of, octahedron, over_the_poles, turned
from .test_accurate_lookup import found, rays_through_the_cube


def test_every_entry_is_what_the_ray_between_its_samples_meets():
    n, surface = 3, surface_of(over_the_poles(turned(octahedron(2))))
    field = field_of(surface, n)
    points = samples(n)
    met = 0
    for i, s in enumerate(points):
        for j, t in enumerate(points):
            along_the_cube = ((s == t) & (s * (1.0 - s) == 0.0)).any()
            face, distance = (-1, np.inf) if along_the_cube else by_brute_force(surface, s, t - s)
            assert (field.faces[i, j] < 0) == (face < 0)
            met += face >= 0
            if face >= 0:
                assert field.fractions[i, j] == pytest.approx(distance, abs=1e-6)
            else:
                assert field.fractions[i, j] == 1.0
    assert met > 500


def test_a_ray_that_touches_two_faces_returns_one_of_them():
    n, surface = 4, ball(1)
    field = field_of(surface, n)
    positions = samples(n)
    corners = surface.triangles[:, :9].astype(float).reshape(-1, 3, 3)
    i, j = np.nonzero(field.faces >= 0)
    points = positions[i] + field.fractions[i, j][:, None] * (positions[j] - positions[i])
    a, b, c = corners[field.faces[i, j]].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    off = ((points - a) * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)
    np.testing.assert_allclose(off, 0.0, atol=1e-6)


def test_batches_make_the_same_table():
    n, surface = 4, ball(2)
    whole = field_of(surface, n)
    cuts = [0, 1, 37, 96]
    batches = [build_rows(surface, n, a, b) for a, b in pairwise(cuts)]
    field = outer_field(n, batches)
    np.testing.assert_array_equal(field.faces, whole.faces)
    np.testing.assert_array_equal(field.fractions, whole.fractions)


def test_a_table_with_rows_missing_is_rejected():
    with pytest.raises(InvalidInput, match="batches"):
        outer_field(4, [build_rows(ball(1), 4, 0, 90)])


@pytest.mark.parametrize("rows", [(-1, 3), (5, 4), (90, 97)])
def test_rejects_missing_rows(rows):
    with pytest.raises(InvalidInput, match="rows"):
        build_rows(ball(1), 4, *rows)


def test_entries_next_to_a_hit_give_start_points():
    n, surface = 4, ball(2)
    field = field_of(surface, n)
    row, beyond = 6 * n, 0
    for i, j in np.argwhere(field.faces < 0):
        around = set()
        for axis, at in ((0, i), (1, j)):
            for step, place in ((1, at % n), (row, at // row)):
                for to, there in ((at - step, place > 0), (at + step, place < n - 1)):
                    if there:
                        around.add(int(field.faces[(to, j) if axis == 0 else (i, to)]))
        hits = {face for face in around if face >= 0}
        assert boundary_face(field.faces[i, j]) in (hits or {-1})
        beyond += bool(hits)
    assert beyond > 100


def test_a_table_may_stay_in_a_file(tmp_path):
    n, surface = 4, ball(2)
    field = field_of(surface, n)
    np.save(tmp_path / "faces.npy", field.faces)
    np.save(tmp_path / "fractions.npy", field.fractions)
    mapped = OuterField(
        n, np.load(tmp_path / "faces.npy", mmap_mode="r"), np.load(tmp_path / "fractions.npy", mmap_mode="r")
    )
    rays = rays_through_the_cube(500, 11)
    for ours, theirs in zip(found(surface, mapped, *rays, 8), found(surface, field, *rays, 8), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def cells():
    """Entry, exit and indices of the sixteen entries of each cell at resolution 3."""
    corners = np.array([0, 1, 18, 19])
    inner = [start for start in range(36) if start % 3 != 2]
    for entry in inner:
        for exit_ in inner:
            yield entry, exit_, np.ix_(entry + corners, exit_ + corners)


def test_agreement_is_that_of_the_sixteen():
    field = field_of(surface_of(over_the_poles(dented(3))), 3)
    agreeing = agreement(field)
    seen = set()
    for entry, exit_, at in cells():
        meets, points = field.faces[at] >= 0, field.fractions[at]
        expected = NONE if not meets.any() else MIXED
        if meets.all() and np.ptp(points) <= np.float32(APART / 3):
            expected = AGREE
        assert agreeing[entry, exit_] == expected
        seen.add(expected)
    assert seen == {NONE, AGREE, MIXED}


def test_the_lowest_and_the_highest_of_the_sixteen_decide():
    """Positions drawn at random, as far apart as the limit: about half of the cells agree."""
    n = 3
    random = np.random.default_rng(1)
    spread = np.float32(1.1 * APART / n)
    fractions = random.uniform(-1.0, -1.0 + spread, (54, 54)).astype(np.float32) + np.float32(1.0)
    agreeing = agreement(OuterField(n, np.zeros((54, 54), np.int32), fractions))
    counts = {AGREE: 0, MIXED: 0}
    for entry, exit_, at in cells():
        expected = AGREE if np.ptp(fractions[at]) <= np.float32(APART / n) else MIXED
        assert agreeing[entry, exit_] == expected
        counts[expected] += 1
    assert min(counts.values()) > 50


def test_entries_are_what_rays_from_the_points_meet():
    surface = surface_of(over_the_poles(turned(dented(3))))
    points, _ = spread_points(surface, 4)
    field = inner_of(surface, 4, 4)
    corners = surface.triangles[points, :9].astype(float).reshape(-1, 3, 3)
    positions = samples(4)
    for row, start in enumerate(corners.mean(axis=1)):
        starts = np.tile(start, (len(positions), 1))
        own = np.full(len(positions), points[row], dtype=np.int32)
        faces, distances, _, _ = first_faces(surface, starts, positions - start, own)
        faces[distances > 1.0] = -1
        # The points' last bits depend on the order of sums.
        assert (field.faces[row] != faces).mean() < 0.02


def test_a_ball_meets_itself_inside_and_not_outside():
    surface = surface_of(over_the_poles(turned(octahedron(3))))
    points, _ = spread_points(surface, 6)
    field = inner_of(surface, 5, 6)
    corners = surface.triangles[points, :9].astype(float).reshape(-1, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ahead = samples(5)[None, :, :] - corners.mean(axis=1)[:, None, :]
    inward = (ahead * normal[:, None, :]).sum(axis=2) / np.linalg.norm(normal, axis=1)[:, None]
    assert (field.faces[inward < -0.02] >= 0).all()
    assert (field.faces[inward > 0.0] == -1).all()


def test_points_are_close_to_the_faces_they_stand_for_and_on_their_side():
    surface = surface_of(over_the_poles(dented(4)))
    points, starts = spread_points(surface, 8)
    corners = surface.triangles[:, :9].astype(float).reshape(-1, 3, 3)
    middles = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    chosen = points[starts]
    assert np.abs(middles - middles[chosen]).max() <= 1.0 / 8.0 + 1e-9
    assert ((normal * normal[chosen]).sum(axis=1) > 0.0).mean() > 0.99
    np.testing.assert_array_equal(starts[points], np.arange(len(points)))


def test_batches_of_points_make_the_same_table():
    surface = ball(2)
    points, starts = spread_points(surface, 3)
    whole = inner_of(surface, 3, 3)
    batches = [build_inner_rows(surface, 3, part) for part in np.array_split(points, 4)]
    field = inner_field(3, starts, batches)
    np.testing.assert_array_equal(field.faces, whole.faces)
    with pytest.raises(InvalidInput, match="batches"):
        inner_field(3, starts, batches[:-1])


@pytest.mark.parametrize("divisions", [0, 257])
def test_other_divisions_are_rejected(divisions):
    with pytest.raises(InvalidInput, match="divisions"):
        spread_points(ball(1), divisions)


NUMBERS = st.sampled_from([2, 3, 5, 24, 48])


def numbers_of(points, n):
    """Numbers of the samples nearest to points of the cube's surface, on the face that each lies on."""
    positions = np.asarray(points)
    face = np.stack([np.abs(positions), np.abs(1.0 - positions)], axis=-1).reshape(-1, 6).argmin(axis=1)
    others = np.array([[1, 2], [0, 2], [0, 1]])[face // 2]
    x, y = np.clip((np.take_along_axis(positions, others, axis=1) * n).astype(np.int64), 0, n - 1).T
    return 6 * n * y + face * n + x


@kernel
def number_lines(origins, directions, n, pairs):
    """Numbers of the samples at which lines enter and leave the cube; −1 for lines that miss it."""
    for k in range(origins.shape[1]):
        near, far, s, sx, sy, t, tx, ty = line_of(
            origins[0, k], origins[1, k], origins[2, k], directions[0, k], directions[1, k], directions[2, k]
        )
        meets = near < far
        pairs[0, k] = number_at(s, sx, sy, n) if meets else -1
        pairs[1, k] = number_at(t, tx, ty, n) if meets else -1


def lines(origins: np.ndarray, directions: np.ndarray, n: int) -> np.ndarray:
    pairs = np.empty((2, len(origins)), dtype=np.int64)
    number_lines(np.float32(origins).T.copy(), np.float32(directions).T.copy(), n, pairs)
    return pairs


@given(n=NUMBERS)
def test_every_sample_has_its_own_number(n):
    np.testing.assert_array_equal(numbers_of(samples(n), n), np.arange(6 * n * n))


def test_numbers_are_those_of_figure_24():
    n = 5
    for face in range(6):
        for x, y in ((0, 0), (3, 1), (4, 4)):
            position = samples(n)[6 * n * y + x + face * n]
            across = [axis for axis in range(3) if axis != face // 2]
            assert position[face // 2] == face % 2
            np.testing.assert_allclose(position[across], [(x + 0.5) / n, (y + 0.5) / n])


@given(n=NUMBERS, seed=st.integers(0, 2**32 - 1))
def test_a_line_between_two_samples_has_their_numbers(n, seed):
    pairs = np.random.default_rng(seed).integers(0, 6 * n * n, (50, 2))
    ends = samples(n)[pairs]
    # Two ends on one face: a line along it, not through the cube.
    same_face = (pairs[:, 0] % (6 * n) // n) == (pairs[:, 1] % (6 * n) // n)
    pairs, ends = pairs[~same_face], ends[~same_face]
    along = ends[:, 1] - ends[:, 0]
    for start in (ends[:, 0], ends[:, 0] - 0.7 * along, ends[:, 0] + 0.3 * along):
        np.testing.assert_array_equal(lines(start, along, n), pairs.T)


@given(seed=st.integers(0, 2**32 - 1))
def test_lines_that_miss_the_cube_have_none(seed):
    random = np.random.default_rng(seed)
    direction = random.normal(size=(20, 3))
    away = np.cross(direction, random.normal(size=(20, 3)))
    # Farther from the middle than the corners are.
    origin = 0.5 + 0.87 * away / np.linalg.norm(away, axis=1, keepdims=True)
    assert (lines(origin, direction, 8) == -1).all()


def test_a_line_along_a_face_stays_on_it():
    n = 4
    pairs = lines(np.array([[-1.0, 0.3, 1.0], [-1.0, 0.3, 0.0]]), np.array([[1.0, 0.0, 0.0]] * 2), n)
    expected = [numbers_of([[0.0, 0.3, z], [1.0, 0.3, z]], n) for z in (0.99, 0.01)]
    assert (pairs[0] % (6 * n) // n == 0).all()
    assert (pairs[1] % (6 * n) // n == 1).all()
    assert [pairs[0, 0] // (6 * n), pairs[0, 1] // (6 * n)] == [e[0] // (6 * n) for e in expected]


@pytest.mark.parametrize("n", [1, 49])
def test_other_numbers_of_samples_are_rejected(n):
    with pytest.raises(InvalidInput, match="samples"):
        samples(n)

"""The outer field: entries of a small one against the exact intersector, batches, agreement of cells."""

from itertools import pairwise

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables.agreement import AGREE, APART, MIXED, NONE, agreement
from bentray_kernels.geometry_field.tables.cube import samples
from bentray_kernels.geometry_field.tables.outer_field import (
    OuterField,
    boundary_face,
    build_rows,
    outer_field,
)
from bentray_kernels.meshes.surface import surface_of

from ...meshes.test_intersector import by_brute_force
from ..shapes import ball, dented, field_of, octahedron, over_the_poles, turned
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

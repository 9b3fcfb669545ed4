"""The walk from the nearest entry: how far from the exact answer, and that it never makes faces up."""

import numpy as np
import pytest

from bentray_kernels.geometry_field.tables.accurate_lookup import STEPS, find, settle
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.meshes.mesh import Chart
from bentray_kernels.meshes.surface import Surface, surface_of

from ...meshes.examples import bunny, flat_patch, without
from ...meshes.test_intersector import first_faces
from ..shapes import ball, dented, field_of, over_the_poles


def rays_through_the_cube(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """From points of the cube's surface to points of another of its faces."""
    random = np.random.default_rng(seed)
    ends = random.random((2, count, 3))
    faces = random.integers(6, size=count), random.integers(1, 6, size=count)
    for end, face in zip(ends, (faces[0], (faces[0] + faces[1]) % 6), strict=True):
        end[np.arange(count), face // 2] = face % 2
    return ends[0], ends[1] - ends[0]


def found(
    surface: Surface, field: OuterField, origins: np.ndarray, directions: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n = len(origins)
    faces, distances = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.float32)
    weights = np.empty((2, n), dtype=np.float32)
    o, d = (np.ascontiguousarray(a.T, dtype=np.float32) for a in (origins, directions))
    find(surface, field, o, d, steps, faces, distances, weights)
    return faces, distances, weights


def off(surface: Surface, field: OuterField, steps: int, count: int = 20000) -> tuple[np.ndarray, float]:
    """Errors of place, edges of the cube, and the share of rays whose hit or miss is wrong."""
    origins, directions = rays_through_the_cube(count, 1)
    expected, at, _, _ = first_faces(surface, origins, directions)
    faces, distances, _ = found(surface, field, origins, directions, steps)
    both = (faces >= 0) & (expected >= 0)
    length = np.linalg.norm(directions[both], axis=1)
    return np.abs(distances[both] - at[both]) * length, float(((faces >= 0) != (expected >= 0)).mean())


def test_a_ball_is_found_where_it_is():
    surface = ball(5)
    field = field_of(surface, 16)
    errors, wrong = off(surface, field, STEPS)
    assert np.median(errors) < 1e-6
    assert (errors < 1e-5).mean() > 0.99
    assert wrong < 0.01


def test_the_walk_ends_in_the_face_that_the_exact_intersector_meets():
    surface = ball(4)
    field = field_of(surface, 12)
    origins, directions = rays_through_the_cube(5000, 2)
    expected, _, exact, _ = first_faces(surface, origins, directions)
    faces, _, weights = found(surface, field, origins, directions, 60)
    both = (faces >= 0) & (expected >= 0)
    # A convex body: a walk that ends, ends in the only face there is. Points close to an edge may lie on
    # either side of it in float32.
    assert not (expected[faces >= 0] < 0).any()
    inside = exact.min(axis=1) > 1e-3
    inside &= exact.sum(axis=1) < 1.0 - 1e-3
    np.testing.assert_array_equal(faces[both & inside], expected[both & inside])
    np.testing.assert_allclose(weights.T[both & inside], exact[both & inside], atol=2e-3)


def test_the_entry_itself_is_exact():
    from bentray_kernels.geometry_field.tables.cube import samples

    n, surface = 6, ball(3)
    field = field_of(surface, n)
    points = samples(n)
    i, j = np.nonzero(field.faces >= 0)
    for steps in (20, STEPS):
        faces, distances, _ = found(surface, field, points[i], points[j] - points[i], steps)
        at_an_edge = faces != field.faces[i, j]
        assert at_an_edge.mean() < 0.05
        np.testing.assert_allclose(distances, field.fractions[i, j], atol=1e-5)


def test_rays_that_start_before_the_cube_are_the_same_rays():
    surface = ball(4)
    field = field_of(surface, 8)
    origins, directions = rays_through_the_cube(2000, 3)
    faces, distances, _ = found(surface, field, origins, directions, STEPS)
    before, later, _ = found(surface, field, origins - directions, directions, STEPS)
    # Moved starts are rounded differently: at the border of an entry a ray may get the other one.
    same = before == faces
    assert same.mean() > 0.995
    np.testing.assert_allclose(later[same] - 1.0, distances[same], atol=1e-5)


def test_every_face_of_a_ball_is_found_from_above_its_middle():
    surface = ball(3)
    corners = surface.triangles[:, :9].reshape(-1, 3, 3)
    middle = corners.mean(axis=1)
    inwards = 0.5 - middle
    faces, _, weights = found(surface, field_of(surface, 8), middle - 2.0 * inwards, inwards, STEPS)
    np.testing.assert_array_equal(faces, np.arange(len(faces)))
    np.testing.assert_allclose(weights, 1.0 / 3.0, atol=1e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_walk_over_an_open_patch_ends_below_the_ray_or_nowhere(side):
    """From every face to places on the patch and beside it."""
    patch = flat_patch(5, 4).in_unit_cube()
    surface = surface_of(Chart(patch, np.zeros((len(patch.faces), 3, 2))))
    corners = surface.triangles[:, :9].reshape(-1, 3, 3).astype(float)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    up = np.sign(np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0])[2]) * side
    random = np.random.default_rng(0)
    for x, y in low[:2] + random.uniform(-0.4, 1.4, (60, 2)) * (high - low)[:2]:
        a, b, c = np.moveaxis(corners[..., :2], 1, 0)
        system = np.stack([a - c, b - c], axis=-1)
        this, two = np.linalg.solve(system, (np.array([x, y]) - c)[..., None])[..., 0].T
        below = np.flatnonzero((this >= 0.0) & (two >= 0.0) & (this + two <= 1.0))
        expected = below[0] if len(below) else -1
        for first in range(len(corners)):
            face, away, _, _ = settle(surface, first, side, 60, x, y, low[2] + up, 0.0, 0.0, -up)
            assert face == expected
            assert away == pytest.approx(1.0)
            assert settle(surface, first, -side, 60, x, y, low[2] + up, 0.0, 0.0, -up)[0] == -1


def test_a_walk_that_leaves_the_mesh_ends_there():
    """A strip of squares with a hole between the first face and the place below the ray."""
    strip = without(flat_patch(7, 3), [7, 19]).in_unit_cube()
    surface = surface_of(Chart(strip, np.zeros((len(strip.faces), 3, 2))))
    middle = surface.triangles[:, :9].reshape(-1, 3, 3).mean(axis=1).astype(float)
    upper = middle[:, 1] > np.median(middle[:, 1])
    first = np.flatnonzero(upper)[middle[upper, 0].argmax()]
    x, y, z = middle[np.flatnonzero(upper)[middle[upper, 0].argmin()]]
    assert settle(surface, first, 1.0, 60, x, middle[first, 1], z + 1.0, 0.0, 0.0, -1.0)[0] == -1
    x, y, z = middle[first]
    assert settle(surface, first, 1.0, 60, x, y, z + 1.0, 0.0, 0.0, -1.0)[0] == first


def test_the_first_row_of_the_triangles_is_a_face_as_any_other():
    surface = ball(3)
    random = np.random.default_rng(0)
    corners = surface.triangles[0, :9].reshape(3, 3).astype(float)
    points = random.dirichlet((3.0, 3.0, 3.0), 200) @ corners
    inwards = 0.5 - points + random.uniform(-0.25, 0.25, (200, 3))
    origins = points - 3.0 * inwards
    expected, _, _, _ = first_faces(surface, origins, inwards)
    faces, _, _ = found(surface, field_of(surface, 4), origins, inwards, 60)
    assert (expected == 0).mean() > 0.9
    assert (faces[expected == 0] == 0).mean() > 0.9


def test_positions_lie_on_the_returned_faces():
    surface = surface_of(over_the_poles(dented(4)))
    field = field_of(surface, 10)
    origins, directions = rays_through_the_cube(5000, 4)
    faces, distances, weights = found(surface, field, origins, directions, 100)
    met = faces >= 0
    corners = surface.triangles[faces[met], :9].reshape(-1, 3, 3)
    share = np.column_stack([weights.T[met], 1.0 - weights.T[met].sum(axis=1)])
    on_face = np.einsum("kc,kcx->kx", share, corners)
    on_ray = origins[met] + distances[met, None] * directions[met]
    assert np.quantile(np.linalg.norm(on_face - on_ray, axis=1), 0.99) < 1e-5


def test_empty_field_returns_no_hit():
    surface = ball(1)
    empty = field_of(surface, 4)
    empty.faces[:] = -1
    faces, distances, _ = found(surface, empty, *rays_through_the_cube(300, 5), STEPS)
    assert (faces == -1).all()
    assert np.isinf(distances).all()


@pytest.mark.real
@pytest.mark.nightly
def test_the_bunny_keeps_target_g2():
    mesh = bunny().in_unit_cube()
    surface = surface_of(Chart(mesh, np.zeros((len(mesh.faces), 3, 2))))
    errors, wrong = off(surface, field_of(surface, 24), STEPS, 100_000)
    assert np.median(errors) < 1e-6
    assert wrong <= 0.021


def test_a_walk_does_not_go_on_in_another_part_of_the_mesh():
    """Two squares apart from each other: from the one no walk ends in the other."""
    strip = flat_patch(4, 2)
    strip = without(strip, [1, 4]).in_unit_cube()
    surface = surface_of(Chart(strip, np.zeros((len(strip.faces), 3, 2))))
    middle = surface.triangles[:, :9].reshape(-1, 3, 3).mean(axis=1).astype(float)
    left = middle[:, 0] < 0.5
    assert left.sum() == 2
    for goal, (x, y, z) in enumerate(middle):
        for first in range(4):
            face = settle(surface, first, 1.0, 9, x, y, z + 1.0, 0.0, 0.0, -1.0)[0]
            assert face == (goal if left[goal] == left[first] else -1)

"""The exact intersector against all triangles one by one, and rays against the plane of a face."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.meshes.face_plane import beyond, meet_plane
from bentray_kernels.meshes.intersector import intersect
from bentray_kernels.meshes.mesh import Chart, TriangleMesh
from bentray_kernels.meshes.surface import Surface, surface_of

from ...effort import effort
from ..geometry_field.shapes import ball, octahedron, over_the_poles, random_triangles


def first_faces(
    surface: Surface, origins: np.ndarray, directions: np.ndarray, ignored: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """Faces, distances, weights and sides."""
    n = len(origins)
    ignored = np.full(n, -1, dtype=np.int32) if ignored is None else ignored
    faces, distances = np.empty(n, dtype=np.int32), np.empty(n)
    weights, outside = np.empty((n, 2)), np.empty(n, dtype=bool)
    intersect(surface, origins, directions, ignored, faces, distances, weights, outside)
    return faces, distances, weights, outside


def by_brute_force(surface: Surface, origin: np.ndarray, direction: np.ndarray) -> tuple[int, float]:
    """The first face in double precision, by solving for its weights; −1 and ∞ for none."""
    a, b, c = surface.triangles[:, :9].astype(float).reshape(-1, 3, 3).transpose(1, 0, 2)
    matrices = np.stack([b - a, c - a, np.broadcast_to(-direction, a.shape)], axis=-1)
    regular = np.abs(np.linalg.det(matrices)) > 1e-14
    result = np.full((len(a), 3), np.nan)
    result[regular] = np.linalg.solve(matrices[regular], (origin - a)[regular][..., None])[..., 0]
    u, v, s = result.T
    hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (s > 0.0)
    if not hit.any():
        return -1, np.inf
    face = int(np.where(hit, s, np.inf).argmin())
    return face, float(s[face])


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 60))
@settings(max_examples=effort(20, 40), deadline=None)
def test_the_first_face_is_that_of_brute_force(seed, count):
    surface = surface_of(random_triangles(seed, count))
    random = np.random.default_rng(seed)
    origins, directions = random.uniform(-1.0, 2.0, (30, 3)), random.normal(size=(30, 3))
    directions[:3] = np.eye(3)
    faces, distances, weights, outside = first_faces(surface, origins, directions)
    for k in range(30):
        face, distance = by_brute_force(surface, origins[k], directions[k])
        assert faces[k] == face
        assert distances[k] == pytest.approx(distance, rel=1e-9)
        if face >= 0:
            corners = surface.triangles[face, :9].astype(float).reshape(3, 3)
            position = np.array([*weights[k], 1.0 - weights[k].sum()]) @ corners
            np.testing.assert_allclose(position, origins[k] + distance * directions[k], atol=1e-9)
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            assert outside[k] == (normal @ directions[k] < 0.0)


def test_no_ray_slips_between_faces():
    mesh = octahedron(3)
    surface = surface_of(over_the_poles(mesh))
    # From within, exactly through vertices and middles of edges, and through anything else.
    random = np.random.default_rng(0)
    corners = surface.triangles[:, :9].astype(float).reshape(-1, 3, 3)
    edges = corners[:, [0, 1, 2]] * 0.5 + corners[:, [1, 2, 0]] * 0.5
    targets = np.concatenate([corners.reshape(-1, 3), edges.reshape(-1, 3), random.random((20000, 3))])
    for origin in ([0.5, 0.5, 0.5], [0.37, 0.61, 0.45]):
        starts = np.tile(origin, (len(targets), 1))
        faces, _, _, outside = first_faces(surface, starts, targets - origin)
        assert (faces >= 0).all()
        assert not outside.any()


def test_rays_that_leave_a_face_meet_the_other_side():
    surface = ball(4)
    corners = surface.triangles[:, :9].astype(float).reshape(-1, 3, 3)
    middles = corners.mean(axis=1)
    own = np.arange(len(middles), dtype=np.int32)
    faces, distances, _, outside = first_faces(surface, middles, 0.5 - middles, own)
    assert (faces >= 0).all()
    assert not outside.any()
    np.testing.assert_allclose(distances, 2.0, atol=1e-2)
    faces, _, _, _ = first_faces(surface, middles, middles - 0.5, own)
    assert (faces == -1).all()


def test_faces_at_one_place_do_not_make_the_hierarchy_endless():
    corners = np.tile([[0.2, 0.2, 0.5], [0.8, 0.2, 0.5], [0.2, 0.8, 0.5]], (500, 1))
    mesh = TriangleMesh(corners, np.arange(1500, dtype=np.int32).reshape(-1, 3))
    surface = surface_of(Chart(mesh, np.zeros((500, 3, 2))))
    faces, distances, _, _ = first_faces(surface, np.array([[0.3, 0.3, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    assert faces[0] >= 0
    assert distances[0] == pytest.approx(0.5)


def test_neighbours_share_two_corners():
    surface = ball(2)
    corners = surface.triangles[:, :9].reshape(-1, 3, 3)
    for face, links in enumerate(surface.links[:, 9:12]):
        for edge, other in enumerate(links):
            ends = {tuple(corners[face, edge]), tuple(corners[face, (edge + 1) % 3])}
            assert ends <= {tuple(corner) for corner in corners[other]}


def test_every_face_stands_in_the_order_once():
    surface = surface_of(random_triangles(3, 777))
    np.testing.assert_array_equal(np.sort(surface.order), np.arange(777))


def test_a_mesh_outside_the_cube_is_rejected():
    mesh = octahedron(0)
    outside = TriangleMesh(mesh.vertices + 0.1, mesh.faces)
    with pytest.raises(InvalidInput, match="vertices"):
        surface_of(over_the_poles(outside))


def test_a_mesh_without_faces_is_rejected():
    empty = TriangleMesh(np.zeros((3, 3)), np.zeros((0, 3), dtype=np.int32))
    with pytest.raises(InvalidInput, match="faces"):
        surface_of(Chart(empty, np.zeros((0, 3, 2))))


@given(seed=st.integers(0, 2**32 - 1))
def test_distance_and_weights_solve_the_linear_system(seed):
    random = np.random.default_rng(seed)
    corners, point, direction = (
        random.uniform(-1.0, 1.0, (4, 3, 3)),
        random.normal(size=3),
        random.normal(size=3),
    )
    triangles = np.zeros((4, 16), np.float32)
    triangles[:, :9] = corners.reshape(4, 9)
    for face in range(4):
        a, b, c = triangles[face, :9].reshape(3, 3).astype(float)
        system = np.column_stack([direction, a - b, a - c])
        if abs(np.linalg.det(system)) < 0.1:
            continue
        away, second, third = np.linalg.solve(system, a - point)
        met = meet_plane(triangles, face, *point, *direction)
        assert met[:4] == pytest.approx((away, 1.0 - second - third, second, third), abs=1e-4, rel=1e-4)
        assert met[4] == pytest.approx(-direction @ np.cross(b - a, c - a), abs=1e-4)


@pytest.mark.parametrize(
    ("weights", "across"),
    [
        ((0.2, 0.3, 0.5), 1),
        ((0.6, 0.5, -0.1), 70),
        ((-0.1, 0.5, 0.6), 71),
        ((0.6, -0.1, 0.5), 72),
        ((-0.3, -0.2, 1.5), 71),
        ((1.005, 0.0, -0.005), 1),
    ],
)
def test_the_neighbour_lies_behind_the_farthest_edge(weights, across):
    links = np.zeros((2, 16), np.int32)
    links[1, 9:12] = 70, 71, 72
    assert beyond(links, 1, *weights, 0.01) == across

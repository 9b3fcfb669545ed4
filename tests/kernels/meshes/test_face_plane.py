"""Ray and plane of a face: the solution of the linear system, and the neighbour on the side of the point."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.meshes.face_plane import beyond, meet_plane


@given(seed=st.integers(0, 2**32 - 1))
@settings(deadline=None)
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

"""Backdrops, flat and warped: where a ray ends, on which plane, and what colour is there."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.refraction import Backdrop, Plane, backdrop_of, checkerboard
from bentray_kernels.refraction.backdrop import colour_at, locate

RNG = np.random.default_rng(1)
PICTURE = RNG.integers(0, 256, (3, 4, 3), dtype=np.uint8)


@kernel
def colour(backdrop: Backdrop, plane: int, u: float, v: float) -> tuple[float, float, float]:
    return colour_at(backdrop, plane, u, v)


def located(backdrop: Backdrop, points, directions) -> tuple[np.ndarray, np.ndarray]:
    points, directions = np.array(points, dtype=float), np.array(directions, dtype=float)
    planes, positions = np.empty(len(points), dtype=np.int8), np.empty((len(points), 2))
    locate(backdrop, points, directions, planes, positions)
    return planes, positions


def wall(z: float, size: float = 2.0, **options) -> Plane:
    return Plane((0.0, 0.0, z), (size, 0.0, 0.0), (0.0, size, 0.0), PICTURE, **options)


def test_a_ray_ends_on_the_nearest_plane_that_it_meets():
    backdrop = backdrop_of(
        [wall(3.0, 8.0), wall(2.0, 2.0), checkerboard((0, 0, -5), (1, 0, 0), (0, 1, 0), 2)]
    )
    planes, points = located(
        backdrop,
        [[0.5, -0.25, 0.0], [1.5, 0.0, 0.0], [9.0, 9.0, 0.0], [0, 0, 0], [7.0, 0.0, 0.0], [0, 0, 0]],
        [[0, 0, 1], [0, 0, 1], [0, 0, -2.0], [1, 0, 0], [0, 0, 1], [0.1, 0.0, 1.0]],
    )
    assert planes.tolist() == [1, 0, 2, -1, -1, 1]
    np.testing.assert_allclose(points[[0, 1, 2, 5]], [[0.25, -0.125], [0.1875, 0.0], [9.0, 9.0], [0.1, 0.0]])
    assert np.isnan(points[[3, 4]]).all()


def test_pixels_are_squares_or_run_into_each_other():
    squares, smooth = backdrop_of([wall(1.0, smooth=False)]), backdrop_of([wall(1.0)])
    for row in range(3):
        for column in range(4):
            u, v = (column + 0.5) / 4 - 0.5, (row + 0.5) / 3 - 0.5
            for backdrop in (squares, smooth):
                np.testing.assert_allclose(colour(backdrop, 0, u, v), PICTURE[row, column], atol=1e-9)
    np.testing.assert_allclose(colour(squares, 0, -0.26, -0.17), PICTURE[0, 0])
    halfway = PICTURE[:2, :2].astype(float).mean(axis=(0, 1))
    np.testing.assert_allclose(colour(smooth, 0, -0.25, 1 / 3 - 0.5), halfway, atol=1e-9)
    # Over the edge of a picture that stands alone nothing comes in from the other side.
    np.testing.assert_allclose(colour(smooth, 0, -0.5, -0.5), PICTURE[0, 0])


def test_checkerboard_is_infinite():
    backdrop = backdrop_of([checkerboard((0, 0, 1), (8.0, 0, 0), (0, 8.0, 0), 8, ((9, 8, 7), (1, 2, 3)))])
    for x, y in RNG.uniform(-20, 20, (200, 2)):
        white = (np.floor(x) + np.floor(y)) % 2 == 0
        assert colour(backdrop, 0, x / 8.0, y / 8.0) == ((9, 8, 7) if white else (1, 2, 3))


def test_beyond_all_planes_is_one_colour():
    assert colour(backdrop_of([wall(1.0)], (5, 6, 7)), -1, np.nan, np.nan) == (5, 6, 7)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"picture": PICTURE.astype(float)}, "picture"),
        ({"picture": PICTURE[..., 0]}, "picture"),
        ({"right": (0.0, 0.0, 0.0)}, "right, down"),
        ({"down": (1.0, 1.0, 0.0)}, "right, down"),
        ({"repeats": 0.0}, "repeats"),
    ],
)
def test_rejects_invalid_planes(change, field):
    good = {"centre": (0.0, 0.0, 1.0), "right": (1.0, 0.0, 0.0), "down": (0.0, 1.0, 0.0), "picture": PICTURE}
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        Plane(**(good | change))


def test_no_plane_is_rejected():
    with pytest.raises(InvalidInput, match="planes: found none"):
        backdrop_of([])


def hilly(relief, *, endless=False, size=2.0):
    edges = (size, 0.0, 0.0), (0.0, 0.7 * size, 0.0)
    return Plane((0.1, -0.2, 3.0), *edges, PICTURE, endless=endless, relief=relief)


def height_at(relief, u, v):
    """Bilinear, mirrored beyond the rectangle."""
    rows, columns = relief.shape
    x, y = (np.asarray(u) + 0.5) * (columns - 1), (np.asarray(v) + 0.5) * (rows - 1)
    j, i = np.floor(x).astype(int), np.floor(y).astype(int)

    def node(k, n):
        k = k % (2 * n - 2)
        return np.where(k < n, k, 2 * n - 2 - k)

    def at(k, m):
        return relief[node(k, rows), node(m, columns)]

    a, b = x - j, y - i
    return (1 - b) * ((1 - a) * at(i, j) + a * at(i, j + 1)) + b * (
        (1 - a) * at(i + 1, j) + a * at(i + 1, j + 1)
    )


def above(plane, points):
    """u, v and the height over the surface."""
    offset = points - np.array(plane.centre)
    u, v = offset[..., 0] / plane.right[0], offset[..., 1] / plane.down[1]
    return u, v, offset[..., 2] - height_at(plane.relief, u, v)


@pytest.mark.parametrize("endless", [False, True])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_the_first_crossing_is_found(endless, seed):
    random = np.random.default_rng(seed)
    plane = hilly(random.uniform(-0.4, 0.4, (4, 6)), endless=endless)
    points = random.uniform(-1.5, 1.5, (20, 3))
    directions = random.normal((0.0, 0.0, 0.8), 1.0, (20, 3))
    planes, positions = located(backdrop_of([plane]), points, directions)
    s = np.linspace(0.0, 12.0, 24_001)
    u, v, off = above(plane, points[:, None] + s[:, None] * directions[:, None])
    inside = np.ones(u.shape, bool) if endless else (np.abs(u) < 0.5) & (np.abs(v) < 0.5)
    crossed = (off[:, 1:] * off[:, :-1] <= 0.0) & inside[:, 1:] & inside[:, :-1]
    # By u or v, whichever changes more.
    start, per_step = (
        np.stack([u[:, 0], v[:, 0]], axis=1),
        np.stack([u[:, 1] - u[:, 0], v[:, 1] - v[:, 0]], axis=1),
    )
    axis = np.abs(per_step).argmax(axis=1)
    rays = np.arange(len(points))
    step = (positions[rays, axis] - start[rays, axis]) / per_step[rays, axis]
    for k in rays:
        earlier = crossed[k] if planes[k] < 0 else crossed[k, : max(int(step[k] - 0.01), 0)]
        assert not earlier.any()
        if planes[k] == 0:
            assert abs(above(plane, points[k] + step[k] * (s[1] - s[0]) * directions[k])[2]) < 1e-8


def test_flat_and_tilted_reliefs_are_planes():
    random = np.random.default_rng(3)
    points, directions = random.uniform(-0.5, 0.5, (200, 3)), random.normal((0.0, 0.0, 2.0), 1.0, (200, 3))
    shifted = Plane((0.1, -0.2, 3.25), (2.0, 0.0, 0.0), (0.0, 1.4, 0.0), PICTURE)
    flat = located(backdrop_of([hilly(np.full((5, 3), 0.25))]), points, directions)
    expected = located(backdrop_of([shifted]), points, directions)
    np.testing.assert_array_equal(flat[0], expected[0])
    np.testing.assert_allclose(flat[1], expected[1], atol=1e-12)
    tilted = hilly(np.tile(np.linspace(-0.3, 0.5, 4), (2, 1)))
    planes, where = located(backdrop_of([tilted]), points, directions)
    hit = planes == 0
    assert hit.sum() > 20
    # On the plane z = 3.1 + 0.8·u, and on the ray.
    z = 3.1 + 0.8 * where[hit, 0]
    s = (z - points[hit, 2]) / directions[hit, 2]
    np.testing.assert_allclose(points[hit, 0] + s * directions[hit, 0], 0.1 + 2.0 * where[hit, 0], atol=1e-9)
    np.testing.assert_allclose(points[hit, 1] + s * directions[hit, 1], -0.2 + 1.4 * where[hit, 1], atol=1e-9)


def test_the_nearer_of_a_hill_and_a_plane_is_seen():
    hill = np.zeros((3, 3))
    hill[1, 1] = -1.0
    behind = checkerboard((0.0, 0.0, 2.5), (9.0, 0.0, 0.0), (0.0, 9.0, 0.0), 4)
    for planes in ([hilly(hill), behind], [behind, hilly(hill)]):
        plane, _ = located(backdrop_of(planes), [[0.1, -0.2, 0.0], [0.9, 0.3, 0.0]], [[0, 0, 1], [0, 0, 1]])
        mountain = planes.index(behind) ^ 1
        assert plane.tolist() == [mountain, 1 - mountain]


def test_rays_along_an_endless_surface_end_nowhere():
    plane = hilly(np.array([[0.0, 0.1], [0.1, 0.0]]), endless=True)
    planes, points = located(
        backdrop_of([plane]), [[0.0, 0.0, 3.05], [0.0, 0.0, 9.0]], [[0, 0, 0.0], [1, 0, 0.0]]
    )
    assert planes.tolist() == [-1, -1]
    assert np.isnan(points).all()


@pytest.mark.parametrize("relief", [np.zeros(4), np.zeros((1, 5)), np.full((3, 3), np.nan)])
def test_bad_reliefs_are_rejected(relief):
    with pytest.raises(InvalidInput, match="relief"):
        hilly(relief)

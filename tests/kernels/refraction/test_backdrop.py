"""Backdrops: where a ray ends, on which plane, and what colour is there."""

import numpy as np
import pytest

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
    with pytest.raises(InvalidInput) as refusal:
        Plane(**(good | change))
    assert refusal.value.field == field


def test_no_plane_is_rejected():
    with pytest.raises(InvalidInput, match="planes: found none"):
        backdrop_of([])

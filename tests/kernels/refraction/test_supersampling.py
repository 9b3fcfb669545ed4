"""Supersampling after refraction: the low-pass of known patterns, and nothing across a border."""

import numpy as np
import pytest

from bentray_kernels.refraction import backdrop_of, checkerboard
from bentray_kernels.refraction.backdrop import Backdrop, Plane
from bentray_kernels.refraction.coarse_rays import Hits
from bentray_kernels.refraction.supersampling import averaged, point_colours, post_refraction_colours

BOARD = backdrop_of([checkerboard((0, 0, 1), (8, 0, 0), (0, 8, 0), 8, ((200,) * 3, (0,) * 3))])


def regular(n: int, across: float, shift: float = 0.0) -> tuple[np.ndarray, ...]:
    """Planes, places and interfaces of n × n pixels that look straight at the board."""
    position = (np.arange(n) + 0.5) / n * across + shift
    positions = np.stack(np.meshgrid(position, position), axis=-1)
    return np.zeros((n, n), dtype=np.int8), positions, np.zeros((n, n), dtype=np.int16)


def hits(planes, positions, crossed, weights) -> Hits:
    light = np.ones(planes.shape) if weights is None else weights
    return Hits(planes, positions, np.zeros(planes.shape, np.uint8), crossed, light)


def post(backdrop: Backdrop, planes, positions, crossed, degree=1, weights=None) -> np.ndarray:
    image = np.empty((*planes.shape, 3), dtype=np.uint8)
    post_refraction_colours(backdrop, hits(planes, positions, crossed, weights), degree, image)
    return image


def points(backdrop: Backdrop, planes, positions, weights=None) -> np.ndarray:
    image = np.empty((*planes.shape, 3), dtype=np.uint8)
    point_colours(backdrop, hits(planes, positions, np.zeros(planes.shape, np.int16), weights), image)
    return image


def test_the_samples_lie_a_third_of_the_way_to_the_neighbours():
    planes, positions, crossed = regular(4, 4 / 64)
    positions[..., 1] = 1.0 / 32
    # The edge of a square lies at 0: a quarter of the way from column 2 to column 1.
    positions[..., 0] = np.array([-1.25, -0.75, 0.25, 1.25]) / 64
    image, plain = post(BOARD, planes, positions, crossed), points(BOARD, planes, positions)
    assert plain[1].tolist() == [[0] * 3, [0] * 3, [200] * 3, [200] * 3]
    assert image[1, :, 0] == pytest.approx([0, 0, 200 * 2 / 3, 200], abs=1)
    # A fifth and two fifths of the way.
    finer = post(BOARD, planes, positions, crossed, 2)
    assert finer[1, :, 0] == pytest.approx([0, 0, 200 * 4 / 5, 200], abs=1)


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_pixels_within_one_square_stay_as_they_are(degree):
    planes, positions, crossed = regular(32, 1.0)
    plain, smooth = points(BOARD, planes, positions), post(BOARD, planes, positions, crossed, degree)
    inner = (np.abs(positions * 8 - np.round(positions * 8)) > 0.3).all(axis=-1)
    np.testing.assert_array_equal(smooth[inner], plain[inner])


def test_a_higher_degree_comes_closer_to_the_mean_over_the_pixel():
    # Pixels as large as squares: the mean over each is known from many samples.
    planes, positions, crossed = regular(40, 0.9 * 5.0, shift=0.013)
    fine = regular(40 * 32, 0.9 * 5.0, shift=0.013)
    truth = points(BOARD, *fine[:2])[..., 0].reshape(40, 32, 40, 32).mean(axis=(1, 3))
    errors = [np.abs(points(BOARD, planes, positions)[1:-1, 1:-1, 0] - truth[1:-1, 1:-1]).mean()]
    for degree in (1, 2, 4):
        image = post(BOARD, planes, positions, crossed, degree)[1:-1, 1:-1, 0]
        errors.append(np.abs(image - truth[1:-1, 1:-1]).mean())
    assert errors[0] > errors[1] > errors[2] > errors[3]


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_samples_of_an_undistorted_view_are_those_of_real_supersampling(degree):
    """A turned and sheared board: between places on a plane grid bilinear interpolation is exact."""
    n, times = 24, 2 * degree + 1

    def view(row, column):
        i, j = np.meshgrid(row, column, indexing="ij")
        # No sample lies on the edge of a square, where rounding decides.
        return np.stack((0.0131 + 0.041 * j + 0.017 * i, -0.0211 + 0.032 * i - 0.008 * j), axis=-1)

    still = np.zeros((n, n), dtype=np.int8), view(np.arange(n), np.arange(n)), np.zeros((n, n), np.int16)
    fine = (np.arange(n * times) - degree) / times
    samples = points(BOARD, np.zeros((n * times,) * 2, np.int8), view(fine, fine))
    image = post(BOARD, *still, degree)
    assert len(np.unique(image)) > times
    np.testing.assert_allclose(
        image[1:-1, 1:-1].astype(int), averaged(samples, times)[1:-1, 1:-1].astype(int), atol=1
    )


def test_no_interpolation_between_different_hits():
    planes, positions, crossed = regular(8, 1.0)
    crossed[:, 4:] = 2
    positions[:, 4:] += 0.37
    planes[0] = -1
    positions[0] = np.nan
    image, plain = post(BOARD, planes, positions, crossed), points(BOARD, planes, positions)
    parts = [
        post(BOARD, p, q, c)
        for p, q, c in (
            (planes[1:, :4].copy(), positions[1:, :4].copy(), crossed[1:, :4].copy()),
            (planes[1:, 4:].copy(), positions[1:, 4:].copy(), crossed[1:, 4:].copy()),
        )
    ]
    inner = np.s_[2:-1]
    np.testing.assert_array_equal(image[1:, :3][inner], parts[0][:, :3][inner])
    np.testing.assert_array_equal(image[1:, 5:][inner], parts[1][:, 1:][inner])
    np.testing.assert_array_equal(image[0], plain[0])


def test_smooth_pictures_are_filtered_as_well_and_light_is_weakened():
    picture = np.zeros((8, 8, 3), dtype=np.uint8)
    picture[:, ::2] = 240
    backdrop = backdrop_of([Plane((0, 0, 1), (1, 0, 0), (0, 1, 0), picture, 4.0)])
    planes, positions, crossed = regular(32, 1.0, -0.5)
    weights = np.full((32, 32), 0.5)
    plain, image = (
        points(backdrop, planes, positions, weights),
        post(backdrop, planes, positions, crossed, 1, weights),
    )
    assert plain.max() == 120
    assert image[1:-1, 1:-1].std() < 0.8 * plain[1:-1, 1:-1].std()


def bilinear(plane: Plane, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Colours of an interpolated picture, (..., 3)."""
    rows, columns = plane.picture.shape[:2]
    alone = plane.repeats == 1.0 and not plane.endless
    x, y = ((np.mod((place + 0.5) * plane.repeats, 1.0)) for place in (u, v))
    x, y = x * columns - 0.5, y * rows - 0.5
    left, upper = np.floor(x).astype(int), np.floor(y).astype(int)
    t, w = (x - left)[..., None], (y - upper)[..., None]

    def at(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        if alone:
            return plane.picture[row.clip(0, rows - 1), column.clip(0, columns - 1)]
        return plane.picture[row % rows, column % columns]

    above = (1 - t) * at(upper, left) + t * at(upper, left + 1)
    below = (1 - t) * at(upper + 1, left) + t * at(upper + 1, left + 1)
    return (1 - w) * above + w * below


def sampled(plane: Plane, points: np.ndarray, pieces: np.ndarray, i: int, j: int, degree: int) -> np.ndarray:
    """Mean of the samples of one pixel, by the definition."""
    rows, columns = pieces.shape
    total = np.zeros(3)
    for a in range(-degree, degree + 1):
        for b in range(-degree, degree + 1):
            p, q = i + (1 if a >= 0 else -1), j + (1 if b >= 0 else -1)
            position = points[i, j]
            inside = 0 <= p < rows and 0 <= q < columns
            if inside and (pieces[[i, p, p], [q, j, q]] == pieces[i, j]).all():
                t, w = abs(a) / (2 * degree + 1), abs(b) / (2 * degree + 1)
                position = (1 - t) * ((1 - w) * position + w * points[i, q])
                position = position + t * ((1 - w) * points[p, j] + w * points[p, q])
            total += bilinear(plane, *position)
    return total / (2 * degree + 1) ** 2


@pytest.mark.parametrize("degree", [1, 2, 5])
@pytest.mark.parametrize(("repeats", "endless"), [(1.0, False), (1.0, True), (2.5, True)])
def test_pixels_of_a_picture_are_means_of_samples_between_their_neighbours(repeats, endless, degree):
    rng = np.random.default_rng(1)
    picture = rng.integers(0, 256, (19, 23, 3), dtype=np.uint8)
    plane = Plane((0, 0, 1), (1, 0, 0), (0, 1, 0), picture, repeats, endless=endless)
    squares = checkerboard((0, 0, 2), (1, 0, 0), (0, 1, 0), 8)
    backdrop = backdrop_of([squares, plane])
    planes, points, crossed = regular(12, 0.9 if not endless else 2.6, -0.45)
    points = (points + 0.01 * rng.standard_normal(points.shape)).clip(-0.5, None if endless else 0.5)
    planes[:], planes[:2], planes[10:, 5:] = 1, -1, 0
    points[:2] = np.nan
    crossed[6:, :4] = 2
    weights = rng.random(planes.shape)
    image = post(backdrop, planes, points, crossed, degree, weights)
    pieces = np.where(planes == 1, crossed, -9)
    seen = planes == 1
    expected = np.array([sampled(plane, points, pieces, i, j, degree) for i, j in np.argwhere(seen)])
    np.testing.assert_allclose(image[seen], expected * weights[seen][:, None], atol=3.0)
    # A step is 1/64 of a texel: on average the colours differ by less than rounding does.
    assert np.abs(image[seen] - expected * weights[seen][:, None]).mean() < 0.6
    assert (image[planes < 0] == 0).all()
    alone = post(backdrop_of([squares]), np.where(planes == 1, -1, planes).astype(np.int8), points, crossed)
    np.testing.assert_array_equal(image[planes == 0] > 0, alone[planes == 0] > 0)


def test_real_samples_are_averaged():
    image = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    means = image.reshape(2, 2, 3, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(averaged(image, 2), means, atol=0.5)
    np.testing.assert_array_equal(averaged(image, 1), image)

"""The samples of the cube: their numbers, and where rays enter and leave."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.compilation.compiled import kernel
from bentray_kernels.errors import InvalidInput
from bentray_kernels.geometry_field.tables.cube import line_of, number_at, samples

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


@settings(deadline=None)
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


@settings(deadline=None)
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

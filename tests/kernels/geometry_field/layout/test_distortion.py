"""Measures of distortion on maps whose distortion is known, and layouts as large as the square allows."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.geometry_field.layout.distortion import (
    area_stretch,
    crosses_itself,
    quasi_conformal_factors,
    signed_areas,
)
from bentray_kernels.geometry_field.layout.framing import in_unit_square

CORNERS = np.array([[(0.0, 0.0, 0.0), (2.0, 0.0, 1.0), (0.5, 1.0, 0.0)]])


def flat(angle=0.0, stretch=1.0):
    """The triangle in its own plane, turned and pulled along x."""
    first, second = CORNERS[0, 1] - CORNERS[0, 0], CORNERS[0, 2] - CORNERS[0, 0]
    x = first / np.linalg.norm(first)
    y = second - (second @ x) * x
    y /= np.linalg.norm(y)
    points = np.array([(0.0, 0.0), (first @ x, first @ y), (second @ x, second @ y)])
    c, s = math.cos(angle), math.sin(angle)
    return (points @ np.array([(c, s), (-s, c)]) * (stretch, 1.0))[np.newaxis]


@given(st.floats(0.0, 7.0), st.floats(1.0, 50.0), st.floats(1e-3, 1e3))
def test_the_factor_is_the_ratio_of_the_stretches(angle, stretch, scale):
    factors = quasi_conformal_factors(CORNERS, scale * flat(angle, stretch))
    assert factors[0] == pytest.approx(stretch, rel=1e-6, abs=1e-6)


def test_flipped_and_flat_faces_have_no_factor():
    assert quasi_conformal_factors(CORNERS, flat()[:, ::-1])[0] == math.inf
    assert quasi_conformal_factors(CORNERS, flat() * (1.0, 0.0))[0] == math.inf
    assert signed_areas(flat())[0] == pytest.approx(np.linalg.norm(np.cross(*(CORNERS[0, 1:]))) / 2)
    assert signed_areas(flat()[:, ::-1])[0] < 0.0


def test_area_stretch_is_one_at_best():
    areas = np.array([1.0, 3.0])
    assert area_stretch(areas, areas / 4.0) == pytest.approx(1.0)
    # Half of the square is enough for twice; uneven is worse than even.
    assert area_stretch(areas, areas / 8.0) == pytest.approx(2.0)
    assert area_stretch(areas, np.array([0.5, 0.5])) > 1.1
    assert area_stretch(areas, np.array([0.5, -0.1])) == math.inf


@given(st.lists(st.floats(0.1, 1.0), min_size=4, max_size=40), st.floats(0.0, 6.0))
def test_stars_do_not_cross_themselves(radii, turn):
    angle = turn + 2 * np.pi * np.arange(len(radii)) / len(radii)
    star = np.array(radii)[:, np.newaxis] * np.column_stack((np.cos(angle), np.sin(angle)))
    assert not crosses_itself(star)
    assert not crosses_itself(star[::-1].copy())


@given(st.integers(4, 60), st.floats(0.0, 6.0), st.data())
def test_two_corners_of_a_round_polygon_that_change_places_make_it_cross_itself(number, turn, data):
    angle = turn + 2 * np.pi * np.arange(number) / number
    polygon = np.column_stack((np.cos(angle), 0.5 * np.sin(angle)))
    index = data.draw(st.integers(0, number - 1))
    pair = [index, (index + 1) % number]
    polygon[pair] = polygon[pair[::-1]]
    assert crosses_itself(polygon)


def test_an_eight_crosses_itself():
    assert crosses_itself(np.array([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]))
    assert not crosses_itself(np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]))


@given(st.floats(0.0, 7.0), st.floats(1e-3, 1e3), st.floats(0.1, 1.0))
def test_a_rectangle_fills_what_it_can(angle, scale, side):
    c, s = np.cos(angle), np.sin(angle)
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, side), (0.0, side)]) @ np.array([(c, s), (-s, c)])
    placed = in_unit_square(scale * corners + 7.0)
    assert placed.min() >= 0.0
    assert placed.max() <= 1.0
    # Upright, or along the diagonal where it is thin: never smaller than upright, less the step of the turns.
    lengths = np.linalg.norm(np.roll(placed, -1, axis=0) - placed, axis=1)
    assert lengths[0] >= 0.98
    assert lengths[1] / lengths[0] == pytest.approx(side, rel=1e-9)


def test_orientation_stays():
    corners = np.random.default_rng(0).uniform(size=(10, 3, 2))
    placed = in_unit_square(corners.reshape(-1, 2)).reshape(corners.shape)
    scale = signed_areas(placed) / signed_areas(corners)
    np.testing.assert_allclose(scale, scale[0])
    assert scale[0] > 0.0

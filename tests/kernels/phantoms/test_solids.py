"""Solids lie where their attributes place them."""

import numpy as np
import pytest

from bentray_kernels.phantoms import Dome, Ellipsoid


def test_ellipsoid_ends_at_its_semi_axes():
    solid = Ellipsoid((1.0, 2.0, 3.0), (0.4, 0.2, 0.1), np.pi / 2)
    # A quarter turn brings the first axis to y.
    ends = np.array([(1.0, 2.4, 3.0), (1.2, 2.0, 3.0), (1.0, 2.0, 2.9)])
    assert solid.level(*ends.T) == pytest.approx(1.0)


@pytest.fixture
def dome():
    return Dome(0.0, 2.0, (0.1, 0.0), (0.5, 0.4), 2.0, (0.0, 0.3), ((3, 0.1),), 0.8)


def test_dome_narrows_to_its_tip_and_drifts_there(dome):
    plain = Dome(0.0, 2.0, (0.1, 0.0), (0.5, 0.4), 2.0, (0.0, 0.3))
    half = np.sqrt(1.0 - 0.25)
    assert plain.level(0.1 + 0.5 * half, np.array(0.3 * 0.25), np.array(1.0)) == pytest.approx(1.0)
    assert plain.level(np.array(0.6), np.array(0.0), np.array(-5.0)) == pytest.approx(1.0)
    assert np.isinf(dome.level(np.array(0.1), np.array(0.3), np.array([2.0, 3.0]))).all()


def test_waves_lift_the_radius_and_turn(dome):
    def radius(angle, z):
        """Where the level along a direction from the axis is 1: it is linear in the distance."""
        t = max(z / 2.0, 0.0)
        x, y = 0.1 + 0.5 * np.cos(angle), 0.3 * t * t + 0.4 * np.sin(angle)
        return 1.0 / dome.level(np.array(x), np.array(y), np.array(z)) / np.sqrt(1.0 - t * t)

    assert radius(0.0, 0.0) == pytest.approx(1.1)
    assert radius(np.pi / 3, 0.0) == pytest.approx(0.9)
    assert radius(0.4, 1.0) == pytest.approx(1.1)

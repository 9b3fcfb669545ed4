"""Angular coverage: the directions of paths through the hull of an array, in 2-D and 3-D."""

import numpy as np
import pytest

from bentray_kernels.acquisition.angular_coverage import angular_coverage
from bentray_kernels.acquisition.simulation.array_shapes import arc, bowl, facing_lines


def coverage(position, used=None):
    """Coverage of the paths between all elements, or those where ``used`` is true."""
    pairs = ~np.eye(len(position), dtype=bool) if used is None else used
    start, end = np.nonzero(pairs)
    return angular_coverage(position, position[start], position[end])


@pytest.mark.parametrize("elements", [8, 16, 32, 64, 256])
def test_a_ring_is_complete_whatever_its_number_of_elements(elements):
    angular = coverage(arc(elements, 0.1).position_m)
    assert not angular.limited
    assert angular.turn_deg is None
    assert str(angular) == "Paths cross the object in every direction."


def test_half_of_the_pairs_of_a_ring_are_complete():
    used = np.random.default_rng(0).random((32, 32)) < 0.5
    assert not coverage(arc(32, 0.1).position_m, used).limited


def test_facing_lines_have_no_paths_along_them():
    used = np.zeros((64, 64), dtype=bool)
    used[:32, 32:] = True
    angular = coverage(facing_lines(32, 0.1, 0.06).position_m, used)
    assert angular.limited
    assert angular.missing_deg == (60.0, 120.0)
    assert 0.4 < angular.visible < 0.65


def test_an_arc_states_its_part_of_the_turn():
    angular = coverage(arc(72, 0.1, 200.0).position_m)
    assert angular.turn_deg == pytest.approx(200.0, abs=3.0)
    low, high = angular.missing_deg
    # The opening of the arc is at 280°: paths along 100° are missing.
    assert 0.5 * (low + high) == pytest.approx(100.0, abs=10.0)


def test_receivers_opposite_the_emitter_alone_limit_the_angle_near_the_edge():
    position = np.arange(64)
    apart = np.abs((position[:, None] - position + 32) % 64 - 32)
    angular = coverage(arc(64, 0.1).position_m, apart >= 26)
    assert angular.limited
    assert angular.turn_deg is None
    assert "elements cover" not in str(angular)
    assert angular.least < angular.visible


def test_a_bowl_is_complete_and_facing_planes_are_not():
    assert not coverage(bowl(200, 0.1).position_m).limited
    side = np.linspace(-0.05, 0.05, 8)
    flat = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    planes = np.concatenate([np.insert(flat, 1, y, axis=1) for y in (-0.05, 0.05)])
    used = np.zeros((128, 128), dtype=bool)
    used[:64, 64:] = True
    angular = coverage(planes, used)
    assert angular.limited
    assert angular.missing_deg is None


def test_too_few_paths_have_no_coverage():
    assert coverage(arc(16, 0.1).position_m, np.eye(16, k=8, dtype=bool)) is None

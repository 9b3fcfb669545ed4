"""Arrays: nodes inside the hull, directions of paths through it, and the pitch of the elements."""

import numpy as np
import pytest

from bentray_kernels.acquisition.angular_coverage import angular_coverage
from bentray_kernels.acquisition.array_hull import _open, check_extent, depth_inside, inside_array
from bentray_kernels.acquisition.element_pitch import element_pitch
from bentray_kernels.acquisition.simulation.array_shapes import arc, bowl, facing_lines
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.errors import InvalidInput

RIM_NODES = 2
SPACING, NODES = 0.002, 48
ORIGIN = (-0.5 * SPACING * (NODES - 1),) * 2
AXIS = ORIGIN[0] + SPACING * np.arange(NODES)
X, Y = np.meshgrid(AXIS, AXIS, indexing="ij")
LINES = facing_lines(16, 0.05, 0.06).position_m


def region(position):
    return inside_array(np.asarray(position), (NODES, NODES), SPACING, ORIGIN, RIM_NODES)


def test_of_a_ring_it_is_the_circle_less_the_rim():
    circle = np.hypot(X, Y) <= 0.04 - RIM_NODES * SPACING
    assert np.array_equal(region(Ring(128, 0.04).positions()), circle)


def test_of_facing_lines_it_is_the_rectangle_between_them():
    rim = RIM_NODES * SPACING - 1e-9
    between = (np.abs(X) <= 0.03 - rim) & (np.abs(Y) <= 0.025 - rim)
    assert np.array_equal(region(LINES), between)


def test_an_element_inside_a_ring_removes_only_the_nodes_near_it():
    ring, inside = Ring(64, 0.04).positions(), np.array([[0.0071, 0.0053]])
    near = np.hypot(*(np.stack((X, Y)) - inside[0][:, None, None])) < RIM_NODES * SPACING
    whole = region(ring)
    assert near.any()
    assert np.array_equal(region(np.concatenate((ring, inside))), whole & ~near)


def test_a_missing_quarter_is_cut_off_along_its_chord():
    ring = Ring(128, 0.04).positions()
    missing = (ring >= -1e-9).all(axis=1)
    chord = ring[~missing].sum(axis=1).max()
    beyond = (X + Y - chord) / np.sqrt(2.0) > -RIM_NODES * SPACING
    assert np.array_equal(region(ring[~missing]), region(ring) & ~beyond)


def test_stacked_rings_keep_the_nodes_above_and_below_them():
    ring, heights = Ring(32, 0.04).positions(), (-0.01, 0.0, 0.01)
    stack = np.concatenate([np.column_stack((ring, np.full(32, z))) for z in heights])
    result = inside_array(stack, (NODES, NODES, 18), SPACING, (*ORIGIN, -0.017), RIM_NODES)
    assert np.array_equal(result, np.repeat(region(ring)[:, :, None], 18, axis=2))


def test_planes_of_elements_above_each_other_are_limits():
    grid = np.stack(np.meshgrid(*[np.linspace(-0.03, 0.03, 9)] * 2), axis=-1).reshape(-1, 2)
    planes = np.concatenate([np.column_stack((grid, np.full(81, z))) for z in (-0.02, 0.02)])
    z = -0.026 + SPACING * np.arange(27)
    result = inside_array(planes, (NODES, NODES, 27), SPACING, (*ORIGIN, -0.026), RIM_NODES)
    kept = z[result.any(axis=(0, 1))]
    assert kept.min() == pytest.approx(-0.016)
    assert kept.max() == pytest.approx(0.016)
    assert np.abs(X[result.any(axis=2)]).max() <= 0.03 - RIM_NODES * SPACING + 1e-9


def test_a_bowl_holds_what_lies_between_its_elements():
    turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rings = [(0.04 * np.cos(t), -0.04 * np.sin(t)) for t in np.deg2rad((0, 20, 40, 60, 75, 90))]
    bowl = np.concatenate(
        [np.column_stack((r * np.cos(turn), r * np.sin(turn), 0 * turn + z)) for r, z in rings]
    )
    result = inside_array(bowl, (NODES, NODES, 27), SPACING, (*ORIGIN, -0.046), RIM_NODES)
    z = -0.046 + SPACING * np.arange(27)
    radius = np.sqrt(X[..., None] ** 2 + Y[..., None] ** 2 + np.minimum(z, 0.0) ** 2)
    assert radius[result & (z <= 0.0)].max() <= 0.04 - RIM_NODES * SPACING
    assert result[(radius < 0.04 - 1.5 * RIM_NODES * SPACING - 0.002) & (z <= 0.0)].all()


@pytest.mark.parametrize(
    ("position", "words"),
    [
        (np.zeros((4, 2)), "at one point"),
        (np.outer(np.arange(8.0), (0.6, 0.8)) + 0.1, "on one line"),
        (np.outer(np.arange(8.0), (0.0, 0.6, 0.8)), "on one line"),
        (np.column_stack((Ring(8, 0.04).positions(), np.full(8, 0.01))), "in one plane"),
    ],
)
def test_elements_without_extent_are_refused(position, words):
    with pytest.raises(InvalidInput, match=f"{words}.*several sides of the object") as refusal:
        check_extent(position)
    assert refusal.value.field == "geometry/element_position_m"


def test_depth_is_the_distance_from_the_nearest_face():
    points = np.array([[0.0, 0.0], [0.02, 0.01], [0.0, 0.03]])
    assert depth_inside(LINES, points) == pytest.approx([0.025, 0.01, -0.005])


@pytest.mark.parametrize("highest", [1, 2, 3, 6])
def test_an_end_whose_highest_elements_lie_on_a_line_is_open(highest):
    angle = 2.0 * np.pi * np.arange(12) / 12
    ring = np.column_stack((20.0 * np.cos(angle), 20.0 * np.sin(angle), np.zeros(12)))
    row = np.column_stack((np.linspace(-4.0, 4.0, highest), np.full(highest, 1.0), np.full(highest, 9.0)))
    assert _open(np.concatenate((ring, row)), 1.0, 2.0)
    # Below there is nothing but the ring; a plate across it closes it.
    assert _open(np.concatenate((ring, row)), -1.0, 2.0)
    plate = np.random.default_rng(0).uniform(-10.0, 10.0, (40, 2))
    assert not _open(np.concatenate((ring, row, np.column_stack((plate, np.zeros(40))))), -1.0, 2.0)


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


def test_the_pitch_of_a_ring_is_the_chord_between_neighbours():
    assert element_pitch(Ring(256, 0.11).positions()) == pytest.approx(0.22 * np.sin(np.pi / 256))


def test_a_gap_does_not_change_it():
    ring = Ring(64, 0.1).positions()
    assert element_pitch(ring[:40]) == pytest.approx(element_pitch(ring))


@pytest.mark.parametrize("position", [np.zeros((1, 2)), np.zeros((5, 3)), np.full((4, 2), np.nan)])
def test_no_distance_is_no_pitch(position):
    assert element_pitch(position) == 0.0


def test_two_elements_have_their_distance():
    assert element_pitch(np.array([[0.0, 0.0], [3.0, 4.0]])) == pytest.approx(5.0)

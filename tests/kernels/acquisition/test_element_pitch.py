"""The pitch of an array: rings, planes, elements in one place."""

import numpy as np
import pytest

from bentray_kernels.acquisition.element_pitch import element_pitch
from bentray_kernels.acquisition.simulation.ring_scan import Ring


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

"""3-D wave scans: the whole breast on the grid, the ring's plane as truth, and recorded delays."""

import numpy as np
import pytest

from bentray_kernels.phantoms import TABLE7_SIDE_M
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.volume_waves import VolumeWaveSettings
from bentray_workers.simulation.waves import BEFORE, SAMPLES_A_PERIOD


class Narrow(VolumeWaveSettings):
    """Edges that send more back, and cost a tenth."""

    edge_nodes = 8


SMALL = Narrow(frequency_hz=1e5, side_m=0.03, elements=8, emissions=1, nodes=32)


@pytest.fixture(scope="module")
def scan():
    return simulate(SMALL)


def test_the_pulse_in_water_comes_when_it_should_and_falls_with_the_distance(scan):
    """In space a pulse keeps its shape; at the next element half of it is over before an edge is heard."""
    far = scan.distance_m()[0, 1]
    sent = np.arange(SMALL.samples) / SAMPLES_A_PERIOD - BEFORE
    late = (sent - far / SMALL.coupling_mps * SMALL.frequency_hz)[sent < 0.3]
    expected = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late) / (4.0 * np.pi * far)
    computed = scan.waveform.water[0, 1, sent < 0.3]
    assert np.linalg.norm(computed - expected) < 0.08 * np.linalg.norm(expected)


def test_object_delays_are_recorded(scan):
    water = scan.waveform.water
    assert np.linalg.norm(scan.waveform.object - water) > 0.005 * np.linalg.norm(water)


def test_the_truth_is_the_plane_of_the_ring(scan):
    assert scan.element_position_m.shape == (8, 2)
    expected = SMALL.phantom.speed(32, TABLE7_SIDE_M)
    np.testing.assert_array_equal(scan.truth.sound_speed_mps, expected)
    assert "Table 7" in scan.title
    assert " by ".join(str(nodes) for nodes in SMALL.grid) in scan.source


def test_the_whole_breast_is_on_the_grid_and_the_ring_about_its_middle():
    settings = VolumeWaveSettings(frequency_hz=1.5e5, side_m=0.03)
    speed, position = settings.speed(), settings.places_m() / settings.spacing_m
    assert speed.shape == settings.grid
    # The breast leaves it at the chest wall alone.
    for axis, face in ((0, 0), (0, -1), (1, 0), (1, -1), (2, -1)):
        assert (speed.take(face, axis) == settings.coupling_mps).all()
    assert (speed[..., 0] != settings.coupling_mps).mean() > 0.3
    ring = round(position[0, 2])
    assert np.allclose(position[:, 2], ring, atol=1e-9)
    # A cell of the volume is as high as wide, one of a plane has no height.
    plane = settings.phantom.speed(settings.fine_nodes, TABLE7_SIDE_M)
    assert np.abs(speed[..., ring] - plane).mean() < 0.2 * np.abs(plane - settings.coupling_mps).mean()
    middle = 0.5 * (settings.fine_nodes - 1)
    assert np.allclose(np.hypot(*(position[:, :2] - middle).T), np.hypot(*(position[0, :2] - middle)))

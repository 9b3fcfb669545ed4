"""Simulated scans of the 3-D phantom: shapes, file, moved ring and rings, rejected settings."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.volume import VolumeSimulationSettings

SMALL = VolumeSimulationSettings(nodes=24, slices=3, elements=10, coupling_mps=1475.0, attenuation=True)
IN_SPACE = replace(SMALL, three_d=True, refinement=2)


@pytest.fixture(scope="module")
def moved():
    return simulate(SMALL)


def test_slices_come_back_from_a_file(moved, tmp_path):
    write_dataset(tmp_path / "moved.h5", moved)
    dataset = read_dataset(tmp_path / "moved.h5")
    assert dataset.slices == 3
    for name in ("delta_tof_s", "log_ratio_np", "slice_z_m", "roi"):
        assert np.array_equal(getattr(dataset, name), getattr(moved, name)), name
    assert dataset.delta_tof_s.shape == dataset.log_ratio_np.shape == (3, 10, 10)
    assert dataset.truth.axes == "x,y,z"
    assert dataset.truth.sound_speed_mps.shape == dataset.truth.attenuation_np_m.shape == dataset.roi.shape
    assert dataset.truth.origin_m[2] == dataset.slice_z_m[0]
    assert dataset.truth.spacing_m[2] == pytest.approx(np.diff(dataset.slice_z_m)[0])
    assert dataset.amplitude_frequency_hz == 7.5e6
    assert dataset.water_attenuation_np_m == 0.0


def test_each_slice_is_the_scan_of_its_plane(moved):
    plane = SMALL.scan().slice(2)
    times, amplitudes = plane.medium(attenuation=True).arrivals(plane.elements(), np.array([0, 7]))
    assert np.array_equal(moved.delta_tof_s[2, [0, 7]], times)
    assert np.array_equal(moved.log_ratio_np[2, [0, 7]], amplitudes)
    assert not np.allclose(moved.delta_tof_s[0], moved.delta_tof_s[2], atol=1e-8)


def test_moved_ring_in_space_is_the_diagonal_of_all_rings_at_once(tmp_path):
    first, all_at_once = (simulate(replace(IN_SPACE, array=array)) for array in ("moved", "rings"))
    assert all_at_once.element_position_m.shape == (30, 3)
    assert all_at_once.slice_z_m is None
    for k in range(3):
        own = slice(10 * k, 10 * k + 10)
        assert np.array_equal(all_at_once.delta_tof_s[own, own], first.delta_tof_s[k])
        assert np.array_equal(all_at_once.log_ratio_np[own, own], first.log_ratio_np[k])
    assert np.isfinite(all_at_once.delta_tof_s).all()
    write_dataset(tmp_path / "rings.h5", all_at_once)
    dataset = read_dataset(tmp_path / "rings.h5")
    assert dataset.array_type == "rings"
    assert np.array_equal(dataset.element_position_m, all_at_once.element_position_m)
    assert np.array_equal(dataset.delta_tof_s, all_at_once.delta_tof_s)


def test_noise_has_the_requested_ratio(moved):
    loud = simulate(replace(SMALL, snr=10.0, seed=5))
    pairs = np.broadcast_to(~np.eye(10, dtype=bool), (3, 10, 10))
    for name in ("delta_tof_s", "log_ratio_np"):
        clean, noisy = getattr(moved, name)[pairs], getattr(loud, name)[pairs]
        assert np.sqrt((clean**2).mean()) / (noisy - clean).std() == pytest.approx(10.0, rel=0.15)
    assert loud.sigma_s[0, 0, 0] == pytest.approx(np.sqrt((moved.delta_tof_s[pairs] ** 2).mean()) / 10.0)
    assert moved.sigma_s is None


def test_amplitudes_are_simulated_only_on_request():
    assert simulate(replace(SMALL, attenuation=False, slices=2)).log_ratio_np is None

"""Simulated datasets of the 2-D phantom: shapes, noise, rejected settings."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.phantoms import TABLE6_SIDE_M, table6_vertical
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_run import simulate

SMALL = SimulationSettings(nodes=32, elements=20, coupling_mps=1400.0)


def test_progress_and_shapes():
    seen = []
    scan = simulate(SMALL, seen.append)
    assert [(p.done, p.total) for p in seen] == [(0, 2), (1, 2), (2, 2)]
    assert scan.truth.sound_speed_mps.shape == scan.roi.shape == (32, 32)
    assert scan.water_speed_mps == 1400.0


def test_noise_has_the_requested_size():
    quiet, loud = simulate(SMALL), simulate(replace(SMALL, noise_s=1e-7, seed=4))
    noise = (loud.delta_tof_s - quiet.delta_tof_s)[~np.eye(20, dtype=bool)]
    assert noise.std() == pytest.approx(1e-7, rel=0.15)
    assert (loud.sigma_s == 1e-7).all()
    assert np.array_equal(simulate(replace(SMALL, noise_s=1e-7, seed=4)).delta_tof_s, loud.delta_tof_s)


def test_amplitudes_are_optional_and_do_not_change_times(tmp_path):
    plain, full = simulate(SMALL), simulate(replace(SMALL, attenuation=True))
    assert plain.log_ratio_np is None
    assert np.array_equal(full.delta_tof_s, plain.delta_tof_s)
    write_dataset(tmp_path / "full.h5", full)
    dataset = read_dataset(tmp_path / "full.h5")
    assert np.array_equal(dataset.log_ratio_np, full.log_ratio_np)
    assert dataset.water_attenuation_np_m == 0.0
    # Across the whole breast: about 4 cm of fat at 15 Np/m and 12 cm of tissue at 50.
    assert 4.0 < dataset.log_ratio_np.max() < 8.0
    assert (np.diag(dataset.log_ratio_np) == 0.0).all()


def test_noise_by_its_ratio_to_the_signal():
    settings = replace(SMALL, attenuation=True)
    quiet, loud = simulate(settings), simulate(replace(settings, snr=10.0, seed=4))
    pairs = ~np.eye(20, dtype=bool)
    for name in ("delta_tof_s", "log_ratio_np"):
        clean, noisy = getattr(quiet, name)[pairs], getattr(loud, name)[pairs]
        assert np.sqrt((clean**2).mean()) / (noisy - clean).std() == pytest.approx(10.0, rel=0.15)
    assert (loud.sigma_s > 0.0).all()


def test_default_reconstruction_grid_is_the_grid_of_the_truth():
    from bentray_kernels.tomography import Problem, Settings

    dataset = simulate(SMALL)
    problem = Problem.from_dataset(dataset, Settings(method="sart", nodes=32))
    assert problem.origin == pytest.approx(dataset.truth.origin_m)
    assert problem.spacing == pytest.approx(dataset.truth.spacing_m[0])


def test_the_vertical_slice_is_simulated_by_its_name():
    scan = simulate(replace(SMALL, phantom="table6-vertical"))
    assert scan.title.startswith("2-D breast phantom (Li 2008, Table 6), vertical slice")
    nodes = SMALL.nodes
    expected = table6_vertical(SMALL.coupling_mps).speed(nodes, TABLE6_SIDE_M)
    np.testing.assert_array_equal(scan.truth.sound_speed_mps, expected)
    np.testing.assert_array_equal(scan.roi, table6_vertical().inside(nodes, TABLE6_SIDE_M))


@pytest.mark.parametrize(
    ("phantom", "title"),
    [
        ("detailed", "2-D breast phantom with glandular texture"),
        ("breast", "2-D breast phantom with skin, fat, gland and four lesions"),
    ],
)
def test_a_breast_with_texture_is_simulated_by_its_name(phantom, title):
    scan = simulate(replace(SMALL, phantom=phantom, coupling_mps=1480.0))
    assert scan.title == f"{title}, coupling 1480 m/s"
    assert scan.truth.sound_speed_mps.max() > 1500.0
    assert PhantomScan(phantom=phantom).plain()["phantom"] == phantom

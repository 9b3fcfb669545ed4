"""Simulated datasets: the same on a cluster and here, noise as asked, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_workers.simulation import SimulationSettings, simulate

SMALL = SimulationSettings(nodes=32, elements=20, coupling_mps=1400.0)


def test_cluster_and_this_machine_agree(cluster):
    seen = []
    here, there = simulate(None, SMALL, seen.append), simulate(cluster.client, SMALL)
    assert np.array_equal(here.delta_tof_s, there.delta_tof_s)
    assert [p.done for p in seen] == [7, 14, 20]
    assert here.truth.sound_speed_mps.shape == here.roi.shape == (32, 32)
    assert here.water_speed_mps == 1400.0


def test_noise_has_the_size_asked_for():
    quiet, loud = simulate(None, SMALL), simulate(None, replace(SMALL, noise_s=1e-7, seed=4))
    noise = (loud.delta_tof_s - quiet.delta_tof_s)[~np.eye(20, dtype=bool)]
    assert noise.std() == pytest.approx(1e-7, rel=0.15)
    assert (loud.sigma_s == 1e-7).all()
    assert np.array_equal(simulate(None, replace(SMALL, noise_s=1e-7, seed=4)).delta_tof_s, loud.delta_tof_s)


def test_default_reconstruction_grid_is_the_grid_of_the_truth():
    from bentray_kernels.tomography import Settings, SliceProblem

    dataset = simulate(None, SMALL)
    problem = SliceProblem.of(dataset, Settings(nodes=32))
    assert problem.origin == pytest.approx(dataset.truth.origin_m)
    assert problem.spacing == pytest.approx(dataset.truth.spacing_m[0])


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"nodes": 8}, "nodes"),
        ({"elements": 2}, "elements"),
        ({"refinement": 1}, "refinement"),
        ({"coupling_mps": 0.0}, "coupling_mps"),
        ({"noise_s": -1.0}, "noise_s"),
    ],
)
def test_bad_settings_are_named(change, field):
    with pytest.raises(InvalidInput) as refusal:
        replace(SMALL, **change)
    assert refusal.value.field == field

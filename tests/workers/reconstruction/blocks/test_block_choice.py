"""A volume is cut into the fewest blocks whose tasks fit a worker, once for each job."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_workers.cluster.capacities import MIB, USABLE, WARM_BYTES, WorkerCapacity
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.dataset.counts import Summary
from bentray_workers.files.dataset.scan import counts_in, read_header
from bentray_workers.reconstruction import job_machine, reconstruction_run
from bentray_workers.reconstruction.blocks.block_choice import fitting_blocks, largest_bytes
from bentray_workers.reconstruction.planning import plan

SCAN = Summary(64, 64, 16 * 64**2, 16, False, 0.06, 0.16, 0, False, decomposition="volume")
VOLUME = Settings(method="sart", nodes=192, decomposition="volume")


def worker(task_bytes):
    return WorkerCapacity(int((task_bytes + WARM_BYTES) / USABLE) + 1, ("recon", "render"))


def test_the_fewest_blocks_that_fit_are_chosen():
    whole = largest_bytes(SCAN, VOLUME)
    assert fitting_blocks(SCAN, VOLUME, [worker(whole)]) == 1
    assert fitting_blocks(SCAN, VOLUME, []) == 1
    assert fitting_blocks(SCAN, VOLUME, [worker(whole - MIB), worker(1)]) == 2
    for blocks in (3, 7, 15):
        needed = largest_bytes(SCAN, VOLUME.changed(blocks=blocks))
        assert fitting_blocks(SCAN, VOLUME, [worker(needed)]) == blocks
    # Blocks thinner than what they read of their neighbours are none.
    assert fitting_blocks(SCAN, VOLUME, [worker(MIB)]) == 1


def test_memory_of_a_task_falls_with_the_blocks():
    sizes = [largest_bytes(SCAN, VOLUME.changed(blocks=blocks)) for blocks in (1, 2, 4, 8)]
    assert all(later < 0.8 * earlier for earlier, later in pairwise(sizes))


def test_the_plan_states_blocks_and_why():
    needed = largest_bytes(SCAN, VOLUME.changed(blocks=4))
    found = plan(SCAN, VOLUME, [worker(needed), worker(needed // 2)])
    assert (found.blocks, found.workers, found.decomposition) == (4, 1, "volume")
    assert "in 4 blocks with times by fast sweeping, since the arrays of the whole volume fit no" in found.why
    assert found.largest[1] == needed
    assert "update_sart" not in found.call_bytes
    undivided = plan(SCAN, VOLUME, [])
    assert undivided.blocks == 1
    assert "blocks" not in undivided.why
    assert found.stored_bytes > undivided.stored_bytes
    assert found.tasks > undivided.tasks
    assert found.work_class != undivided.work_class
    rays = replace(VOLUME, rays="straight")
    straight = plan(SCAN, rays, [worker(largest_bytes(SCAN, rays.changed(blocks=2)))])
    assert straight.blocks == 2
    assert "sweeping" not in straight.why
    assert "sweep_block" not in straight.call_bytes


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"method": "gauss-newton"}, "method gauss-newton"),
        ({"method": "auto"}, "method auto"),
        ({"eikonal": "accurate"}, "eikonal accurate"),
        ({"uncertainty": True}, "uncertainty"),
        ({"attenuation": True}, "attenuation"),
    ],
)
def test_a_refusal_says_what_keeps_a_volume_from_blocks(changes, reason):
    scan = replace(SCAN, amplitudes="attenuation" in changes)
    needed = largest_bytes(SCAN, VOLUME.changed(blocks=4))
    words = f"method sart can compute a volume in blocks, but not with {reason}"
    with pytest.raises(InvalidInput, match=words):
        plan(scan, VOLUME.changed(**changes), [worker(needed)])


@pytest.fixture
def path(tmp_path):
    every = np.arange(5)
    chord = np.sin(np.pi * (every[:, None] - every[None, :]) / 5) ** 2
    delta, heights = -1e-6 * np.stack((chord, 0.5 * chord)), np.array([0.0, 0.01])
    recorded = Dataset(Ring(5, 0.08).positions(), every, every, 1500.0, delta_tof_s=delta, slice_z_m=heights)
    write_dataset(tmp_path / "scan.h5", recorded)
    return tmp_path / "scan.h5"


@pytest.mark.nightly
def test_a_run_is_in_blocks_where_memory_is_short_and_stays_so(path, tmp_path, monkeypatch):
    settings = Settings.from_values(method="sart", nodes=64, decomposition="volume", iterations=1)
    work = tmp_path / "work"

    def memory(scale):
        needed = largest_bytes(counts_in(path).summary(settings), settings)
        monkeypatch.setattr(job_machine, "MEMORY_LIMIT", worker(scale * needed).memory_bytes)

    memory(0.97)
    result = reconstruction_run.reconstruct(None, path, settings, work_dir=work)
    blocks = result.settings.numerics.blocks
    assert blocks > 1
    expected = reconstruct_here(read_header(path).dataset, settings.changed(eikonal="fsm"))
    assert np.allclose(result.speed, expected.speed, rtol=1e-12, atol=0.0)
    memory(10.0)
    again = reconstruction_run.reconstruct(None, path, settings, work_dir=work)
    assert again.settings.numerics.blocks == blocks
    assert np.array_equal(again.speed, result.speed)
    assert reconstruction_run.reconstruct(None, path, settings).settings.numerics.blocks == 1

"""Reflection of a scan file: task by task in one process, its file and exports, and its plan."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_workers.cluster.capacities import USABLE, WARM_BYTES, WorkerCapacity
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.dataset.counts import DatasetCounts
from bentray_workers.files.reconstruction import read_reconstruction, shape_of_quantity, write_reconstruction
from bentray_workers.files.volume_export import Selection, export_volume
from bentray_workers.images.result_summary import result_summary
from bentray_workers.reconstruction.planning import plan
from bentray_workers.reconstruction.reconstruction_run import reconstruct
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

WAVES = WaveSimulationSettings(frequency_hz=2e5, side_m=0.06, elements=24, emissions=12, nodes=32)
SETTINGS = Settings.from_values(
    method="sart", nodes=24, iterations=1, attenuation=False, reflection=True, pixel_m=2e-3
)


@pytest.fixture(scope="module")
def scan():
    return simulate(WAVES)


@pytest.fixture(scope="module")
def path(scan, tmp_path_factory):
    where = tmp_path_factory.mktemp("scan") / "scan.h5"
    write_dataset(where, scan)
    return where


@pytest.fixture(scope="module")
def result(path):
    return reconstruct(None, path, SETTINGS)


def test_file_and_exports_hold_the_image_on_its_own_grid(result, path, tmp_path):
    volume = tmp_path / "reconstruction.h5"
    write_reconstruction(volume, result)
    image = read_reconstruction(volume).reflection
    assert np.array_equal(image.db, result.reflection.db)
    assert (image.spacing_m, image.origin_m) == (result.reflection.spacing_m, result.reflection.origin_m)
    assert shape_of_quantity(volume, "reflection", result.speed.shape) == image.db.shape
    assert shape_of_quantity(volume, "coverage", result.speed.shape) == result.speed.shape
    export_volume(volume, target=tmp_path / "r.npy", name="npy", selection=Selection("reflection"))
    assert np.array_equal(np.load(tmp_path / "r.npy"), image.db)
    export_volume(volume, target=tmp_path / "r.vti", name="vti", selection=Selection("reflection"))
    text = (tmp_path / "r.vti").read_bytes()
    assert b"reflection_db" in text
    assert b"speed_mps" not in text
    summary = result_summary(volume, scan=path)
    assert "reflection" in summary["quantities"]
    assert summary["automatic"] == result.provenance["automatic"] != ""
    assert summary["grids"]["reflection"]["shape"] == list(image.db.shape)
    assert summary["grids"]["reflection"]["spacing_m"] == [2e-3, 2e-3]


def test_result_without_the_image_is_named(result, tmp_path):
    volume = tmp_path / "reconstruction.h5"
    write_reconstruction(volume, replace(result, reflection=None))
    with pytest.raises(InvalidInput, match="quantity"):
        export_volume(volume, target=tmp_path / "r.npy", name="npy", selection=Selection("reflection"))
    with pytest.raises(InvalidInput, match="quantity"):
        shape_of_quantity(volume, "reflection", result.speed.shape)


def test_plan_counts_its_tasks_and_memory(scan):
    counts = DatasetCounts.from_dataset(scan)
    without, with_image = (
        plan(counts.summary(one), one, [])
        for one in (SETTINGS.changed(reflection=False), SETTINGS.changed(pixel_m=None))
    )
    # Two groups of elements, the pulse, one batch of emissions.
    assert with_image.tasks == without.tasks + 4
    assert {"solve_element_times", "measure_scan_pulse", "sum_emissions"} <= set(with_image.call_bytes)
    assert with_image.stored_bytes > without.stored_bytes
    assert with_image.work_s > without.work_s


def test_plan_rejects_more_pixels_than_a_worker_holds(scan):
    fine = SETTINGS.changed(pixel_m=3e-5)
    summary = DatasetCounts.from_dataset(scan).summary(fine)
    planned = plan(summary, fine, []).call_bytes["sum_emissions"]
    # Sums and their parts, 33 bytes for each of the pixels.
    assert planned > 33 * (2.0 * scan.radius_m / 3e-5) ** 2
    worker = WorkerCapacity(int((0.9 * planned + WARM_BYTES) / USABLE), ("recon",))
    with pytest.raises(InvalidInput, match=r"^reflection: .*summing echoes"):
        plan(summary, fine, [worker])


def test_plan_rejects_a_scan_without_traces(scan):
    times = replace(scan, waveform=None, delta_tof_s=np.zeros((12, 24)))
    with pytest.raises(InvalidInput, match="reflection"):
        plan(DatasetCounts.from_dataset(times).summary(SETTINGS), SETTINGS, [])

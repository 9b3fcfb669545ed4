"""All pipelines by one loop: the same bits on a cluster as in this process, also after worker deaths."""

import os
import signal
from dataclasses import replace

import dask
import pytest
from distributed import Client, LocalCluster

from bentray_kernels.meshes.example_surfaces import torus
from bentray_kernels.phantoms import TWO_HOLES, sampled
from bentray_kernels.tomography import Settings
from bentray_workers.cluster.dask_settings import NO_DASHBOARD, ours
from bentray_workers.cluster.resources import OFFERED, THREADS
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.mesh import StoredMesh, write_mesh
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.reconstruction.reconstruction_run import reconstruct
from bentray_workers.rendering import geometry_field as geometry_field_module
from bentray_workers.rendering.field_settings import FieldSettings
from bentray_workers.rendering.geometry_field import build_field
from bentray_workers.rendering.turntable import Turntable, draw_turntable
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_run import simulate_to_file

PLAN = Settings(nodes=32, iterations=6, method="gauss-newton", resolution_check=True, uncertainty=True)
SCAN = PhantomScan(waveform=True, nodes=32, elements=16, frequency_hz=2e5, side_m=0.03, emissions=8, snr=20.0)
TURNTABLE = Turntable(iso=(0.5,), width=32, height=24, frames=8)
FIELD = FieldSettings(samples=6, inner_samples=4, divisions=4, image_size=33)


def reconstruction(client, folder, work, on_progress):
    result = reconstruct(client, folder / "scan.h5", PLAN, on_progress, work_dir=work)
    return result.speed.tobytes(), result.recovery.tobytes(), result.uncertainty.tobytes(), result.history


def simulation(client, folder, work, on_progress):
    simulate_to_file(client, SCAN.chosen(), work / "made.h5", work, on_progress=on_progress)
    return (work / "made.h5").read_bytes()


def turntable(client, folder, work, on_progress):
    draw_turntable(client, folder / "volume.h5", TURNTABLE, work / "made.zip", work, on_progress=on_progress)
    return (work / "made.zip").read_bytes()


def geometry_field(client, folder, work, on_progress):
    build_field(client, folder / "mesh.h5", FIELD, work / "made", work, on_progress=on_progress)
    return [path.read_bytes() for path in sorted((work / "made").glob("*.npy"))]


@pytest.fixture
def inputs(scan, tmp_path):
    """Inputs of the pipelines."""
    loud = replace(scan, log_ratio_np=-1e6 * scan.delta_tof_s, water_attenuation_np_m=0.1)
    write_dataset(tmp_path / "scan.h5", loud)
    write_volume(tmp_path / "volume.h5", Volume.from_values(sampled(TWO_HOLES, 12), (1e-3,) * 3))
    write_mesh(tmp_path / "mesh.h5", StoredMesh(torus(16, 10)))
    return tmp_path


@pytest.fixture(scope="module")
def mortal(tmp_path_factory):
    """Two workers in processes of their own; one death is enough for Dask to give a task up."""
    how = {"threads_per_worker": THREADS, "resources": OFFERED, "dashboard_address": NO_DASHBOARD}
    scratch = str(tmp_path_factory.mktemp("scratch"))
    with (
        ours(),
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(n_workers=2, local_directory=scratch, **how) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.mark.nightly
@pytest.mark.parametrize(
    "pipeline",
    [reconstruction, simulation, turntable, geometry_field],
    ids=lambda pipeline: pipeline.__name__,
)
def test_killed_worker_keeps_the_bits(mortal, inputs, pipeline, monkeypatch):
    """Nor does the cluster: the expected bits are those of one thread or more of this process."""
    # Seven tasks for the larger table of the field.
    monkeypatch.setattr(geometry_field_module, "TASK_RAYS", 32 * 6 * 6**2)
    killed, seen = [], []

    def kill(progress):
        seen.append((progress.done, progress.total))
        if 0 < progress.done < progress.total and not killed:
            killed.append(next(iter(mortal.run(os.getpid).values())))
            os.kill(killed[0], signal.SIGKILL)

    works = [inputs / "here", inputs / "there"]
    for work in works:
        work.mkdir()
    expected = pipeline(None, inputs, works[0], None)
    assert pipeline(mortal, inputs, works[1], kill) == expected
    assert killed
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    assert seen[-1][0] == seen[-1][1]

"""SART of a file on a device: all slices in one task of a worker, resumed and repeated to the same bits."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.task_graph import ThreadPool, run
from bentray_kernels.tomography import Settings, stage_graphs
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction.ray_sizes import ray_task_sizes
from bentray_workers.reconstruction.reconstruction_run import reconstruct

from ...table6 import table6_scan

pytestmark = pytest.mark.opencl

SLICES, ELEMENTS, WATER = 3, 16, 1375.0
SETTINGS = Settings.from_values(method="sart", nodes=32, iterations=2, device="opencl")


@pytest.fixture(scope="module")
def stack():
    """Slices of a ring at several heights."""
    scan = table6_scan(ELEMENTS, 32)
    times = np.stack([scan.delta_tof_s * part for part in np.linspace(0.5, 1.0, SLICES)])
    return replace(scan, delta_tof_s=times, slice_z_m=1e-3 * np.arange(SLICES))


@pytest.fixture
def sizes(monkeypatch):
    """Slices in each task."""
    found = []
    advance = stage_graphs.advance_slices

    def counted(calls, settings):
        found.append(len(calls))
        return advance(calls, settings)

    monkeypatch.setattr(stage_graphs, "advance_slices", counted)
    return found


def test_all_slices_are_in_flight_on_one_worker_with_a_device(opencl_session, stack, sizes, tmp_path):
    path = tmp_path / "scan.h5"
    write_dataset(path, stack)
    with open_cluster(workers=1, local_directory=tmp_path / "local", processes=False) as cluster:
        found = reconstruct(cluster.client, path, SETTINGS)
    assert set(sizes) == {SLICES}
    assert np.array_equal(found.speed, reconstruct_here(stack, SETTINGS).speed)
    compiled = reconstruct_here(stack, SETTINGS.changed(device="cpu"))
    assert np.sqrt(((found.speed - compiled.speed) ** 2).mean()) < 0.05
    assert len(found.history) == len(compiled.history) == 2 * SLICES


def test_tasks_are_distributed_over_workers_with_devices(opencl_session, stack, sizes, monkeypatch):
    monkeypatch.setattr(ThreadPool, "devices", lambda _pool: 2)
    found = reconstruct_here(stack, SETTINGS)
    assert set(sizes) == {1, 2}
    monkeypatch.undo()
    assert np.array_equal(found.speed, reconstruct_here(stack, SETTINGS).speed)


def test_tasks_that_run_together_get_their_own_results():
    class Graph:
        done = total = 0

        def __init__(self, name):
            self.name, self.results = name, []

        def first(self):
            return [stage_graphs.Task(abs, (np.full(2, 3.0), self.name), batch_function=self.run)]

        @staticmethod
        def run(calls):
            return [name for _, name in calls]

        def after(self, task, result):
            self.results.append(result)
            return self.first() if len(self.results) < 3 else []

    graphs = {name: Graph(name) for name in "abc"}
    run(graphs, ThreadPool())
    assert {name: graph.results for name, graph in graphs.items()} == {name: [name] * 3 for name in "abc"}


def test_the_plan_counts_what_is_in_flight(stack):
    from bentray_workers.files.dataset.counts import Summary

    def size(slices):
        scan = Summary(512, 512, slices * 512**2, slices, False, 0.0, 0.2, 0, False)
        settings = Settings.from_values(method="sart", nodes=256, device="opencl")
        return ray_task_sizes(scan, settings)["update_sart_slices"].bytes

    assert size(1) > 8 * 512**2 + 30 * 256**2
    assert 0 < size(44) - size(8) < 36 * (size(8) - size(7)), "a processor holds eight slices"

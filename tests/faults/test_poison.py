"""A task that kills its workers fails its own job and no other."""

import os
import threading
from pathlib import Path

import dask
import numpy as np
import pytest
from distributed import Client, KilledWorker, LocalCluster
from distributed.scheduler import NoValidWorkerError, NoWorkerError

from bentray_kernels.task_graph import run
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.reconstruction_graph import ReconstructionGraph
from bentray_workers.cluster.dask_settings import NO_DASHBOARD, ours
from bentray_workers.cluster.resources import OFFERED, THREADS
from bentray_workers.cluster.task_pool import open_pool
from bentray_workers.cluster.task_retries import ResultsLostError
from bentray_workers.reconstruction import reconstruction_run

# For every change tests/workers/cluster/test_pipelines.py kills a worker under the same limit of deaths.
pytestmark = [pytest.mark.slow, pytest.mark.nightly]

PLAN = Settings.from_values(
    nodes=48, attenuation=False, method="gauss-newton", iterations=8, penalty_strength=0.003
)


def test_poison_task_fails_only_its_own_job(scan, scan_file, tmp_path, monkeypatch):
    # The workers find the module on the path that they take over from this process.
    monkeypatch.syspath_prepend(Path(__file__).parent)
    from poison import PoisonedScan

    ends = {}
    # Without the preload, so that workers are back at once.
    how = {"threads_per_worker": THREADS, "resources": OFFERED, "local_directory": str(tmp_path / "scratch")}
    with (
        ours(),
        # One death is enough for Dask to give a task up, so that fewer workers start again.
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(n_workers=2, dashboard_address=NO_DASHBOARD, **how) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):

        def innocent():
            ends["innocent"] = reconstruction_run.reconstruct(
                client, scan_file, PLAN, work_dir=tmp_path / "work"
            )

        def poisoned():
            graph = ReconstructionGraph(PoisonedScan(scan_file, PLAN, os.getpid()), 0)
            try:
                run({"0": graph}, open_pool(client, tmp_path))
            except KilledWorker as error:
                ends["poisoned"] = error

        def again_and_again(part):
            # As the service does it: on a slow machine no worker may be back in time.
            while True:
                try:
                    return part()
                except (NoValidWorkerError, NoWorkerError, ResultsLostError):
                    continue

        threads = [threading.Thread(target=again_and_again, args=[part]) for part in (innocent, poisoned)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(400.0)
        assert isinstance(ends["poisoned"], KilledWorker)
        assert np.array_equal(ends["innocent"].speed, reconstruct(scan, PLAN).speed)
        assert client.submit(os.getpid, pure=False).result(timeout=120.0) > 0

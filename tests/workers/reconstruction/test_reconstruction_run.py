"""Reconstruction of a file: progress, cancellation, errors, and interrupted runs to the same bits."""

import gc
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import count

import h5py
import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.task_graph import Cancelled
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography import reconstruct as reconstruct_here
from bentray_workers.cluster.fair_shares import Shares
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.picking_files import ScanFindings
from bentray_workers.reconstruction import picking_graph, reconstruction_run

from ...waiting import wait_until
from ..cluster.tearing import torn_runs

PLAN = Settings(method="sart", nodes=32, iterations=2)
METHODS = [PLAN, replace(PLAN, method="gauss-newton", iterations=3)]
OTHERS = {
    "auto": replace(PLAN, method="auto"),
    "stages": PLAN.changed(coarser_grids=1, resolution_check=True),
    "volume": PLAN.changed(nodes=20, decomposition="volume", method="gauss-newton"),
}


@pytest.mark.parametrize("plan", METHODS, ids=lambda plan: plan.method)
def test_amplitudes_give_the_attenuation_of_the_kernels(cluster, scan, tmp_path, plan):
    loud = replace(scan, log_ratio_np=-1e6 * scan.delta_tof_s, water_attenuation_np_m=0.1)
    path = tmp_path / "loud.h5"
    write_dataset(path, loud)
    expected = reconstruct_here(loud, plan)
    assert expected.attenuation.shape == expected.speed.shape
    assert expected.attenuation.max() > 1.0
    seen = []
    result = reconstruction_run.reconstruct(cluster.client, path, plan, seen.append)
    assert np.array_equal(result.attenuation, expected.attenuation)
    assert seen[-1].done == seen[-1].total == 3 * (plan.iterations + 1) * 24
    assert reconstruction_run.reconstruct(None, path, plan.changed(attenuation=False)).attenuation is None


@pytest.mark.parametrize("plan", METHODS, ids=lambda plan: plan.method)
def test_progress_rises_to_the_end(cluster, path, plan):
    seen = []
    reconstruction_run.reconstruct(cluster.client, path, plan, seen.append)
    done = [p.done for p in seen]
    assert done == sorted(done)
    assert done[-1] == seen[-1].total == 3 * plan.iterations * 24
    assert len(done) > 6


@pytest.mark.parametrize("plan", METHODS, ids=lambda plan: plan.method)
@pytest.mark.parametrize("embedded", [True, False])
def test_stop_ends_within_a_task(cluster, path, embedded, plan):
    calls = []

    def stop():
        calls.append(None)
        return len(calls) > 2

    with pytest.raises(Cancelled):
        reconstruction_run.reconstruct(
            cluster.client if embedded else None, path, replace(plan, iterations=500), stop=stop
        )
    assert len(calls) == 3


def test_folder_deleted_during_a_task():
    """A call that was told to stop goes on to its end, and may write what it always wrote."""

    def write(folder):
        for number in count():
            try:
                (folder / f"call-{number}").touch()
            except FileNotFoundError:
                return

    for _ in range(20):
        with reconstruction_run._temporary_folder() as folder:
            writer = threading.Thread(target=write, args=[folder])
            writer.start()
            while not any(folder.iterdir()):
                pass
        writer.join()
        assert not folder.exists()


def test_stop_does_not_wait_for_the_picker(cluster, path, monkeypatch):
    done = threading.Event()
    # The workers are threads of this process, so they meet what is put in place here.
    monkeypatch.setattr(picking_graph, "apply", lambda *arguments: done.wait(60.0))
    with pytest.raises(Cancelled):
        reconstruction_run.reconstruct(cluster.client, path, PLAN, stop=lambda: True)
    assert not done.is_set()
    done.set()


def test_a_file_that_was_rewritten_is_read_again(cluster, scan, path):
    before = reconstruction_run.reconstruct(cluster.client, path, PLAN)
    write_dataset(path, replace(scan, delta_tof_s=0.5 * scan.delta_tof_s))
    after = reconstruction_run.reconstruct(cluster.client, path, PLAN)
    assert not np.array_equal(before.speed, after.speed)


def test_bad_input_crosses_the_cluster_as_itself(cluster, path):
    with pytest.raises(InvalidInput, match="side_m"):
        reconstruction_run.reconstruct(cluster.client, path, Settings(method="sart", side_m=0.01))


def test_missing_file_is_named(cluster, tmp_path):
    with pytest.raises((InvalidInput, OSError), match="nothing"):
        reconstruction_run.reconstruct(cluster.client, tmp_path / "nothing.h5", PLAN)


@pytest.mark.parametrize("plan", METHODS, ids=lambda plan: plan.method)
def test_cluster_is_empty_afterwards(cluster, path, plan):
    before = set(cluster.client.futures)
    reconstruction_run.reconstruct(cluster.client, path, plan)
    # A client lets go of futures in a thread of its own; where Dask waited in vain for a while, the frames of
    # its exception hold futures in a cycle.
    wait_until(lambda: gc.collect() >= 0 and set(cluster.client.futures) <= before)


@pytest.mark.parametrize("plan", [*METHODS, *OTHERS.values()], ids=[*(p.method for p in METHODS), *OTHERS])
def test_interrupted_run_resumes_to_the_same_bits(cluster, scan, path, tmp_path, plan):
    expected = reconstruct_here(scan, plan)

    def go_on(tear):
        return reconstruction_run.reconstruct(cluster.client, path, plan, tear, work_dir=tmp_path / "work")

    result, reached = torn_runs(go_on, (4, 12, 8, 20))
    assert reached[0] == 0
    assert reached == sorted(reached)
    assert reached[-1] > 0, "something was restored"
    for name in ("speed", "coverage", "recovery", "residuals"):
        assert np.array_equal(getattr(result, name), getattr(expected, name)), name
    for name in ("history", "settings", "trials"):
        assert getattr(result, name) == getattr(expected, name), name


@pytest.mark.nightly
def test_a_small_job_of_another_tenant_runs_beside_a_large_one_to_the_same_bits(cluster, scan, path):
    """The large one has been there first and fills every worker; it goes on meanwhile and ends as alone."""
    shares, seen = Shares(), []
    large = replace(PLAN, iterations=60)

    def work():
        with shares.of("busy", "recon", cluster.client) as share:
            return reconstruction_run.reconstruct(cluster.client, path, large, seen.append, share=share)

    with ThreadPoolExecutor(1) as pool:
        busy = pool.submit(work)
        while not seen:
            time.sleep(0.01)
        with shares.of("new", "recon", cluster.client) as share:
            small = reconstruction_run.reconstruct(cluster.client, path, PLAN, share=share)
        beside = not busy.done()
        result = busy.result(timeout=120.0)
    assert beside, "the small one did not wait for the end of the large one"
    np.testing.assert_array_equal(small.speed, reconstruction_run.reconstruct(None, path, PLAN).speed)
    np.testing.assert_array_equal(result.speed, reconstruction_run.reconstruct(None, path, large).speed)
    assert result.history[-1].sweep == 60


@pytest.mark.parametrize(
    "plan", [PLAN, replace(PLAN, method="auto"), OTHERS["volume"]], ids=lambda plan: plan.method
)
def test_a_scan_is_opened_once_before_the_first_task(path, monkeypatch, plan):
    opened, counts = [], []

    class Counted(h5py.File):
        def __init__(self, name, *arguments, **options):
            opened.append(name)
            super().__init__(name, *arguments, **options)

    def first_task(graphs, *_):
        counts.append(opened.count(path))
        raise Cancelled

    monkeypatch.setattr(h5py, "File", Counted)
    monkeypatch.setattr(reconstruction_run, "run", lambda *_: None)
    monkeypatch.setattr(reconstruction_run, "read_findings", lambda *_: ScanFindings((), True, False))
    monkeypatch.setattr(reconstruction_run, "run_resumable", first_task)
    with pytest.raises(Cancelled):
        reconstruction_run.reconstruct(None, path, plan)
    assert counts == [1]

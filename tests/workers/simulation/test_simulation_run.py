"""Simulated scans as files: resumed, cancelled at once, damaged parts computed again."""

import hashlib
import threading
import time

import pytest

from bentray_kernels.task_graph import Cancelled
from bentray_kernels.wave import time_blocks
from bentray_workers.cluster.job_cancellation import JobEnded
from bentray_workers.cluster.task_retries import ResultsLostError
from bentray_workers.files.dataset import read_dataset
from bentray_workers.files.dataset.counts import record_of
from bentray_workers.simulation import parts
from bentray_workers.simulation.parts import folder_of, make_part, parts_of
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_run import simulate_to_file

TIMES = PhantomScan(nodes=16, elements=70, snr=10.0, attenuation=True)
WAVES = {"waveform": True, "nodes": 32, "elements": 16, "frequency_hz": 2e5, "side_m": 0.03, "emissions": 4}


@pytest.fixture
def run(cluster, tmp_path):
    """Simulate into ``scan.h5``; ``stop`` as ``simulate_to_file`` takes it."""

    def go(asked, on_progress=None, stop=None):
        work = tmp_path / "work"
        work.mkdir(exist_ok=True)
        scan = tmp_path / "scan.h5"
        return simulate_to_file(
            cluster.client, asked.chosen(), scan, work, on_progress=on_progress, stop=stop
        )

    return go


def test_the_record_is_that_of_the_file(run, tmp_path):
    seen = []
    record = run(TIMES, seen.append)
    content = (tmp_path / "scan.h5").read_bytes()
    assert record.pop("sha256") == hashlib.sha256(content).hexdigest()
    assert record.pop("bytes") == len(content)
    assert record == record_of(read_dataset(tmp_path / "scan.h5"))
    total = len(parts_of(TIMES.chosen())) + 1
    assert [(step.done, step.total) for step in seen] == [(done, total) for done in range(total + 1)]


def test_finished_parts_are_not_recomputed(run, tmp_path):
    done = []
    with pytest.raises(Cancelled):
        run(TIMES, lambda now: done.append(now.done), lambda: bool(done and done[-1]))
    folder = folder_of(tmp_path / "work")
    kept = {path: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    assert kept
    again = []
    run(TIMES, again.append)
    assert again[0].done >= len(kept)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    simulate_to_file(None, TIMES.chosen(), tmp_path / "here.h5")
    assert (tmp_path / "scan.h5").read_bytes() == (tmp_path / "here.h5").read_bytes()


def test_damaged_part_is_recomputed(run, tmp_path):
    run(TIMES)
    first = (tmp_path / "scan.h5").read_bytes()
    damaged = parts_of(TIMES.chosen())[1].path(folder_of(tmp_path / "work"))
    content = bytearray(damaged.read_bytes())
    content[len(content) // 2] ^= 1
    damaged.write_bytes(content)
    with pytest.raises(ResultsLostError, match=r"part-0000-\d+.npz is damaged"):
        run(TIMES)
    assert not damaged.exists()
    run(TIMES)
    assert (tmp_path / "scan.h5").read_bytes() == first


def test_cancellation_does_not_wait_for_the_running_emission(run, tmp_path, monkeypatch):
    begun, ended = threading.Event(), threading.Event()

    def endless(settings, emission, poll):
        begun.set()
        try:
            while True:
                poll()
                time.sleep(0.01)
        finally:
            ended.set()

    monkeypatch.setattr(parts, "simulate_emission", endless)
    try:
        with pytest.raises(Cancelled):
            run(PhantomScan(**WAVES), stop=begun.is_set)
        assert not ended.is_set()
        assert not (tmp_path / "scan.h5").exists()
    finally:
        (tmp_path / "work").rename(tmp_path / "work.ended")
    assert ended.wait(60.0)


def test_emissions_poll_for_cancellation_between_steps(tmp_path, monkeypatch):
    monkeypatch.setattr(time_blocks, "BLOCK", 10**6)
    settings = PhantomScan(**WAVES).chosen()
    polled = []

    def gone(folder):
        polled.append(folder)
        if len(polled) == 3:
            raise JobEnded

    monkeypatch.setattr(parts, "check_job_active", gone)
    make_part(settings, parts_of(settings)[0], tmp_path)
    assert polled == 3 * [tmp_path]
    assert not list(tmp_path.iterdir())


def test_task_of_a_deleted_job_ends_early(tmp_path, monkeypatch):
    settings = TIMES.chosen()
    folder = tmp_path / "gone"
    make_part(settings, parts_of(settings)[0], folder)
    assert not list(tmp_path.iterdir())
    folder.mkdir()
    made = []

    def once(asked, number):
        made.append(number)
        folder.rmdir()
        return real(asked, number)

    real = parts._medium
    monkeypatch.setattr(parts, "_medium", once)
    make_part(settings, parts_of(settings)[0], folder)
    assert len(made) == 1
    assert not list(tmp_path.iterdir())

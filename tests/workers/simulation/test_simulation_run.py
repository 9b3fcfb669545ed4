"""Simulated scans on a cluster: the bits of one process, gone on from, given up at once, mended."""

import hashlib
import threading
import time

import pytest

from bentray_kernels.wave import time_blocks
from bentray_workers.cluster.attempts import ResultsLostError
from bentray_workers.cluster.job_cancellation import Unwanted
from bentray_workers.cluster.task_loop import Cancelled
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.files.dataset.record import record_of
from bentray_workers.simulation import tasks
from bentray_workers.simulation.plane import simulate
from bentray_workers.simulation.request import AskedSimulation
from bentray_workers.simulation.simulation_run import simulate_scan
from bentray_workers.simulation.tasks import folder_of, make_part, parts_of
from bentray_workers.simulation.volume import simulate_volume
from bentray_workers.simulation.waves import simulate_waves

TIMES = AskedSimulation(nodes=16, elements=70, snr=10.0, attenuation=True)
SPACE = {"phantom": "table7", "nodes": 16, "elements": 8, "slices": 2}
WAVES = {"waveform": True, "nodes": 32, "elements": 16, "frequency_hz": 2e5, "side_m": 0.03, "emissions": 4}
SCANS = {
    "times": (TIMES, simulate),
    "a moved ring": (AskedSimulation(**SPACE, noise_s=None), simulate_volume),
    "rings in space": (
        AskedSimulation(**SPACE, array="rings", three_d=True, refinement=2, snr=5.0),
        simulate_volume,
    ),
    "waves": (AskedSimulation(**WAVES), simulate_waves),
    "noisy waves": (AskedSimulation(**WAVES, snr=20.0, seed=3), simulate_waves),
}


def nothing(told=None):
    """Told of something that does not matter here."""


def never():
    return False


@pytest.fixture
def run(cluster, tmp_path):
    """Simulate into ``reconstruction.file_scan.h5``; ``stop`` as ``simulate_scan`` takes it."""

    def go(asked, told=nothing, stop=never):
        work = tmp_path / "work"
        work.mkdir(exist_ok=True)
        return simulate_scan(cluster.client, asked, tmp_path / "scan.h5", work, told, nothing, stop)

    return go


@pytest.mark.parametrize("name", SCANS)
def test_the_file_is_that_of_one_process(run, tmp_path, name):
    asked, here = SCANS[name]
    told = []
    found = run(asked, told.append)
    expected = here(None, asked.chosen())
    write_dataset(tmp_path / "here.h5", expected)
    content = (tmp_path / "here.h5").read_bytes()
    assert (tmp_path / "scan.h5").read_bytes() == content
    assert found.pop("sha256") == hashlib.sha256(content).hexdigest()
    assert found.pop("bytes") == len(content)
    assert found == record_of(read_dataset(tmp_path / "scan.h5"))
    total = len(parts_of(asked.chosen())) + 1
    assert [one.done for one in told] == list(range(total + 1))
    assert {one.total for one in told} == {total}


def test_what_was_kept_is_not_made_again(run, tmp_path):
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
    write_dataset(tmp_path / "here.h5", simulate(None, TIMES.chosen()))
    assert (tmp_path / "scan.h5").read_bytes() == (tmp_path / "here.h5").read_bytes()


def test_a_damaged_part_is_made_anew(run, tmp_path):
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


def test_a_stop_does_not_wait_for_the_emission_at_work_which_ends_with_the_folder(run, tmp_path, monkeypatch):
    begun, ended = threading.Event(), threading.Event()

    def endless(settings, emission, poll):
        begun.set()
        try:
            while True:
                poll()
                time.sleep(0.01)
        finally:
            ended.set()

    monkeypatch.setattr(tasks, "simulate_emission", endless)
    try:
        with pytest.raises(Cancelled):
            run(AskedSimulation(**WAVES), stop=begun.is_set)
        assert not ended.is_set()
        assert not (tmp_path / "scan.h5").exists()
    finally:
        (tmp_path / "work").rename(tmp_path / "work.ended")
    assert ended.wait(60.0)


def test_an_emission_asks_between_its_steps_whether_anybody_waits(tmp_path, monkeypatch):
    monkeypatch.setattr(time_blocks, "STRIP", 10**6)
    settings = AskedSimulation(**WAVES).chosen()
    polled = []

    def gone(folder):
        polled.append(folder)
        if len(polled) == 3:
            raise Unwanted

    monkeypatch.setattr(tasks, "check_wanted", gone)
    make_part(settings, parts_of(settings)[0], tmp_path)
    assert polled == 3 * [tmp_path]
    assert not list(tmp_path.iterdir())


def test_a_task_whose_job_has_gone_ends_early_and_leaves_nothing(tmp_path, monkeypatch):
    settings = TIMES.chosen()
    folder = tmp_path / "gone"
    make_part(settings, parts_of(settings)[0], folder)
    assert not list(tmp_path.iterdir())
    folder.mkdir()
    made = []

    def once(asked, scan, emitters):
        made.append(emitters)
        folder.rmdir()
        return real(asked, scan, emitters)

    real = tasks.simulate_emitters
    monkeypatch.setattr(tasks, "simulate_emitters", once)
    make_part(settings, parts_of(settings)[0], folder)
    assert len(made) == 1
    assert not list(tmp_path.iterdir())

"""Parts are killed at random: no job is lost or doubled, little is done again, and the bits are the same."""

import random
import sqlite3
import time

import numpy as np
import pytest

from bentray_kernels.tomography import reconstruct
from bentray_kernels.tomography.stored_settings import from_stored
from bentray_workers.files.reconstruction import read_reconstruction
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_run import simulate_to_file

from ..effort import effort
from .conftest import ELEMENTS
from .machine import wait_until

pytestmark = [pytest.mark.slow, pytest.mark.nightly]

PLAN = {"nodes": 64, "attenuation": {"enabled": False}}
PLANS = [
    {**PLAN, "method": "sart", "iterations": effort(40, 100)},
    {
        **PLAN,
        "method": "gauss-newton",
        "iterations": effort(12, 30),
        "gauss_newton": {"penalty_strength": 0.003},
    },
    {**PLAN, "method": "sart", "iterations": effort(24, 60), "resolution_check": True},
    {**PLAN, "method": "auto", "iterations": effort(10, 24)},
]

EMISSIONS = 24
WAVES = {"waveform": True, "frequency_hz": 4e5, "side_m": 0.05, "nodes": 32, "elements": 32, "snr": 20.0}

# One of every kind; at night more, and all workers at once with the process above them.
KILLS = effort(3, 20)
TARGETS = ["service", "service", "service", "a worker", "a worker", "scheduler", *effort([], ["workers"])]


def test_killing_any_part_loses_no_job(machine, scan, scan_file):
    chance = random.Random(7)
    dataset = machine.upload(scan_file)
    targets = [*dict.fromkeys(TARGETS), *chance.choices(TARGETS, k=KILLS - len(set(TARGETS)))]
    chance.shuffle(targets)
    jobs = {}
    for target in targets:
        keep_busy(machine, dataset, jobs)
        time.sleep(chance.uniform(0.2, 2.0))
        before = {job: progress_of(machine, job) for job in jobs}
        if target == "a worker":
            machine.kill_a_worker(chance.randrange(2))
        else:
            machine.restart(target)
        if target == "service":
            machine.wait_ready()
            # What is running has gone on from where it was, but for one pass and the newest report.
            for job, (state, done) in before.items():
                if state == "running":
                    # The trials of auto are chains side by side, as many as are in flight on two workers.
                    lost = 5 if jobs[job]["method"] == "auto" else 2
                    assert begun_at(machine, job) >= done - lost * ELEMENTS, (job, before)
    for job, plan in jobs.items():
        assert machine.ended(job)["state"] == "succeeded"
        found = read_reconstruction(machine.files / "volumes" / f"vol-{job.removeprefix('job-')}.h5")
        expected = reconstruct(scan, from_stored(plan))
        assert np.array_equal(found.speed, expected.speed)
        assert found.history == expected.history
    volumes = machine.http.get("/v1/volumes").json()["volumes"]
    assert len(volumes) == len(list((machine.files / "volumes").iterdir())) == len(jobs)
    wait_until(lambda: not list((machine.files / "work").iterdir()))
    assert [path for path in (machine.data, *machine.data.rglob("*")) if path.lstat().st_mode & 0o077] == []
    attempts = sum(attempts_of(machine, job) for job in jobs)
    # Two jobs run at once, and nearly every kill but a worker's, which Dask makes good, tore one.
    assert attempts > len(jobs) + targets.count("service")


def test_simulation_resumes_from_finished_emissions(machine, tmp_path):
    asked = {**WAVES, "emissions": EMISSIONS}
    job = machine.submit(**asked)
    work = machine.files / "work" / job

    def made():
        return len(list(work.rglob("part-*.npz")))

    wait_until(lambda: made() >= 2)
    machine.kill_a_worker()
    wait_until(lambda: made() >= 5)
    machine.kill("service")
    kept = made()
    assert kept < EMISSIONS
    machine.start("service")
    machine.wait_ready()
    assert begun_at(machine, job) >= kept
    done = machine.ended(job)
    assert done["state"] == "succeeded", done["error"]
    assert attempts_of(machine, job) == 2
    simulate_to_file(None, PhantomScan(**asked).chosen(), tmp_path / "scan.h5")
    found = machine.files / "datasets" / f"{done['dataset']}.h5"
    assert found.read_bytes() == (tmp_path / "scan.h5").read_bytes()
    datasets = machine.http.get("/v1/datasets").json()["datasets"]
    assert [one["id"] for one in datasets if one["job"] == job] == [done["dataset"]]
    wait_until(lambda: not work.exists())


def keep_busy(machine, dataset, jobs):
    """Queue more jobs, each by SART with its own bounds, until at least three are not at their end."""
    while sum(machine.job(job)["state"] in ("queued", "running") for job in jobs) < 3:
        plan = PLANS[len(jobs) % len(PLANS)]
        if plan["method"] != "gauss-newton":
            plan = {**plan, "speed_bounds_mps": [1300.0, 1800.0 + len(jobs)]}
        jobs[machine.submit(dataset, **plan)] = plan


def progress_of(machine, job):
    record = machine.job(job)
    return record["state"], record["progress"]["done"]


def begun_at(machine, job):
    """Where a job that was taken up again began."""
    while True:
        record = machine.job(job)
        if record["progress"]["total"] or record["state"] not in ("queued", "running"):
            return record["progress"]["done"]
        time.sleep(0.02)


def attempts_of(machine, job):
    """How often a job was begun; every attempt but the last has gone back to the queue."""
    with sqlite3.connect(machine.data / "bentray.sqlite") as database:
        rows = database.execute("SELECT state FROM events WHERE job_id = ? ORDER BY number", [job])
        states = [state for (state,) in rows]
    assert states == [*(len(states) // 2) * ["queued", "running"], "succeeded"]
    return len(states) // 2

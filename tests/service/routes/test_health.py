"""/health and /v1/cluster: reported state of the service, its workers, its database and its queues."""

import threading

import pytest
from sqlalchemy import text

from bentray_service import readiness
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys


def faults(answer):
    assert answer.status_code == 503
    assert answer.json()["type"] == "/problems/not-ready"
    return [one["field"] for one in answer.json()["errors"]]


def test_all_well(http):
    assert http.get("/health/live").json() == {"status": "alive"}
    body = http.get("/health/ready").json()
    assert (body["status"], body["workers"]) == ("ready", 1)


def test_no_workers(http, cluster):
    cluster.workers = 0
    assert faults(http.get("/health/ready")) == ["workers"]


def test_disk_full(start):
    assert faults(start(min_free_bytes=2**62).get("/health/ready")) == ["disk"]


def test_database_that_cannot_be_written(http):
    with http.app.state.stores.database.write() as connection:
        connection.execute(text("DROP TABLE about"))
    assert faults(http.get("/health/ready")) == ["database"]
    assert http.get("/health/live").status_code == 200


def test_stalled_ingestion_is_reported(http):
    http.app.state.background.ingest.stop()
    assert faults(http.get("/health/ready")) == ["ingest"]


def test_several_faults_are_all_named(start, cluster):
    cluster.workers = 0
    assert faults(start(min_free_bytes=2**62).get("/health/ready")) == ["disk", "workers"]


def test_a_part_that_hangs_is_named_in_time(start, monkeypatch):
    monkeypatch.setattr(readiness, "WITHIN_S", 0.2)
    http, going_on, looks = start(), threading.Event(), []

    def probe():
        looks.append(1)
        assert going_on.wait(60.0)

    monkeypatch.setattr(http.app.state.stores.database, "probe", probe)
    for _ in range(3):
        answer = http.get("/health/ready")
        assert faults(answer) == ["database"]
        assert answer.json()["errors"][0]["found"] == "no answer in 0.2 s"
        assert http.get("/health/live").status_code == 200
    # However many ask, one thread looks.
    assert len(looks) == 1
    going_on.set()
    monkeypatch.undo()
    assert http.get("/health/ready").status_code == 200


pytestmark = pytest.mark.usefixtures("work")


HDF5 = {"Content-Type": "application/x-hdf5"}


def test_the_queue_of_others_is_a_number(http, work, scan, until):
    """Three queued jobs of one tenant behind a running one, seen by that tenant and by another."""
    store, auth = Keys(http.app.state.stores.database), {}
    for tenant in ("acme", "other"):
        token = ApiKey.new()
        store.add(token, Tenant(tenant), tenant, ("read", "write"))
        auth[tenant] = {"Authorization": f"Bearer {token.shown()}"}
    http.headers.update(auth["acme"])
    sent = http.post("/v1/datasets", content=scan().read_bytes(), headers=HDF5).json()["id"]
    work.hold.clear()
    asked = {"kind": "reconstruction", "dataset": sent, "settings": {"method": "sart", "nodes": 16}}
    jobs = [http.post("/v1/jobs", json=asked).json()["id"] for _ in range(4)]
    until(http, jobs[0], "running")
    states = [http.get(f"/v1/jobs/{one}").json()["state"] for one in jobs]
    running, queued = states.count("running"), states.count("queued")
    assert running >= 1
    mine = http.get("/v1/cluster").json()["queue"]
    theirs = http.get("/v1/cluster", headers=auth["other"])
    work.hold.set()
    whole = {"all_queued": queued, "all_running": running, "waiting_images": 0}
    assert mine == {"queued": queued, "running": running, **whole}
    assert theirs.json()["queue"] == {"queued": 0, "running": 0, **whole}
    assert not [name for name in (*jobs, sent, "acme") if name in theirs.text]
    for job in jobs:
        until(http, job)
    assert http.get("/v1/cluster").json()["queue"]["all_running"] == 0


def test_workers_are_named_by_nothing(http, cluster):
    metrics = {"memory": 3 * 2**30, "cpu": 12.5, "task_counts": {"executing": 1}}
    secret = {"name": "tcp://host-of-the-hospital:40001", "host": "10.1.2.3", "local_directory": "/scratch/x"}
    one = {"nthreads": 2, "memory_limit": 4 * 2**30, "resources": {"recon": 1}, "metrics": metrics}
    workers = {"tcp://10.1.2.3:40001": {**one, **secret, "status": "running"}}
    cluster.scheduler_info = lambda n_workers: {"workers": workers}
    answer = http.get("/v1/cluster")
    assert answer.json()["workers"] == [
        {
            "threads": 2,
            "memory_bytes": 3 * 2**30,
            "memory_limit_bytes": 4 * 2**30,
            "cpu_percent": 12.5,
            "running_tasks": 1,
            "paused": False,
            "opencl": False,
            "compiling": False,
        }
    ]
    assert not [name for name in ("10.1.2.3", "hospital", "scratch") if name in answer.text]


def test_without_a_scheduler_there_are_no_workers(http, cluster):
    cluster.scheduler_info = lambda n_workers: {}
    answer = http.get("/v1/cluster")
    assert (answer.status_code, answer.json()["workers"]) == (200, [])

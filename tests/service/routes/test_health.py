"""/health and /v1/cluster: reported state of the service, its workers, its database and its queues."""

import threading

from sqlalchemy import text

from bentray_service import readiness

from ..conftest import signed


def faults(http):
    answer = http.get("/health/ready")
    assert (answer.status_code, answer.json()["type"]) == (503, "/problems/not-ready")
    return [one["field"] for one in answer.json()["errors"]]


def test_all_well(http):
    assert http.get("/health/live").json() == {"status": "alive"}
    body = http.get("/health/ready").json()
    assert (body["status"], body["workers"]) == ("ready", 1)


def test_every_fault_is_named(start, cluster):
    http = start()
    cluster.workers = 0
    assert faults(http) == ["workers"]
    assert faults(start("full", min_free_bytes=2**62)) == ["disk", "workers"]
    cluster.workers = 1
    http.app.state.background.ingest.stop()
    assert faults(http) == ["ingest"]
    with http.app.state.stores.database.write() as connection:
        connection.execute(text("DROP TABLE about"))
    assert sorted(faults(http)) == ["database", "ingest"]
    assert http.get("/health/live").status_code == 200


def test_a_part_that_hangs_is_named_in_time(start, monkeypatch):
    monkeypatch.setattr(readiness, "WITHIN_S", 0.2)
    http, going_on, looks = start(), threading.Event(), []

    def probe():
        looks.append(1)
        assert going_on.wait(60.0)

    monkeypatch.setattr(http.app.state.stores.database, "probe", probe)
    for _ in range(3):
        assert faults(http) == ["database"]
        assert http.get("/health/ready").json()["errors"][0]["found"] == "no answer in 0.2 s"
        assert http.get("/health/live").status_code == 200
    # However many ask, one thread looks.
    assert len(looks) == 1
    going_on.set()
    monkeypatch.undo()
    assert http.get("/health/ready").status_code == 200


def test_the_queue_of_others_is_a_number(http, work, uploaded, submitted, until):
    """Three queued jobs of one tenant behind a running one, seen by that tenant and by another."""
    acme, other = signed(http, "acme"), signed(http, "other")
    http.headers.update(acme)
    sent = uploaded(http)
    work.hold.clear()
    jobs = [submitted(http, sent)["id"] for _ in range(4)]
    until(http, jobs[0], "running")
    states = [http.get(f"/v1/jobs/{one}").json()["state"] for one in jobs]
    running, queued = states.count("running"), states.count("queued")
    assert running >= 1
    mine = http.get("/v1/cluster").json()["queue"]
    theirs = http.get("/v1/cluster", headers=other)
    work.hold.set()
    whole = {
        "all_queued": queued,
        "all_running": running,
        "waiting_images": 0,
        "drawing_workers": 0,
        "images_s": None,
    }
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

"""/health: reported state of the service, its workers and its database."""

import threading

from sqlalchemy import text

from bentray_service import readiness


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

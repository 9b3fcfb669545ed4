"""/health: it tells the truth."""

from sqlalchemy import text


def faults(answer):
    assert answer.status_code == 503
    assert answer.json()["type"] == "/problems/not-ready"
    return [one["field"] for one in answer.json()["errors"]]


def test_all_well(start):
    http = start()
    assert http.get("/health/live").json() == {"status": "alive"}
    body = http.get("/health/ready").json()
    assert (body["status"], body["workers"]) == ("ready", 1)


def test_no_workers(start, cluster):
    http = start()
    cluster.workers = 0
    assert faults(http.get("/health/ready")) == ["workers"]


def test_disk_full(start):
    assert faults(start(min_free_bytes=2**62).get("/health/ready")) == ["disk"]


def test_database_that_cannot_be_written(start):
    http = start()
    with http.app.state.parts.database.write() as connection:
        connection.execute(text("DROP TABLE about"))
    assert faults(http.get("/health/ready")) == ["database"]
    assert http.get("/health/live").status_code == 200


def test_uploads_that_nobody_reads(start):
    http = start()
    http.app.state.parts.reader.stop()
    assert faults(http.get("/health/ready")) == ["reader"]


def test_several_faults_are_all_named(start, cluster):
    cluster.workers = 0
    assert faults(start(min_free_bytes=2**62).get("/health/ready")) == ["disk", "workers"]

"""/v1/jobs/{id}/events: every change once, in order, from where the client was, and an end."""

import json
import threading

import pytest

from bentray_service.routes import events


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(events, "INTERVAL_SECONDS", 0.01)


def parsed(text):
    blocks = [block for block in text.split("\n\n")[:-1] if not block.startswith(":")]
    return [dict(line.split(": ", 1) for line in block.split("\n")) for block in blocks]


def test_a_job_from_its_beginning_to_its_end(start, uploaded, submitted, until, work):
    http = start()
    work.hold.clear()
    job = submitted(http, uploaded(http))
    until(http, job["id"], "running")
    threading.Timer(0.3, work.hold.set).start()
    answer = http.get(f"/v1/jobs/{job['id']}/events")
    assert answer.headers["content-type"].startswith("text/event-stream")
    assert answer.headers["cache-control"] == "no-store"
    told = parsed(answer.text)
    states = [(int(one["id"]), json.loads(one["data"])["state"]) for one in told if one["event"] == "state"]
    assert [state for _, state in states] == ["queued", "running", "succeeded"]
    assert [number for number, _ in states] == sorted({number for number, _ in states})
    progress = [json.loads(one["data"]) for one in told if one["event"] == "progress"]
    assert progress
    assert all("id" not in one for one in told if one["event"] == "progress")
    assert progress[-1]["total"] == 24
    later = parsed(
        http.get(f"/v1/jobs/{job['id']}/events", headers={"Last-Event-ID": str(states[1][0])}).text
    )
    assert [json.loads(one["data"])["state"] for one in later] == ["succeeded"]
    assert http.get(f"/v1/jobs/{job['id']}/events", headers={"Last-Event-ID": str(states[2][0])}).text == ""


def test_it_ends_when_the_service_leaves(start, uploaded, submitted, until, work):
    http = start()
    work.hold.clear()
    job = submitted(http, uploaded(http))
    until(http, job["id"], "running")
    threading.Timer(0.2, http.app.state.leaving.set).start()
    told = parsed(http.get(f"/v1/jobs/{job['id']}/events").text)
    assert [json.loads(one["data"])["state"] for one in told if one["event"] == "state"] == [
        "queued",
        "running",
    ]


def test_silence_is_broken(start, uploaded, submitted, until, work, monkeypatch):
    monkeypatch.setattr(events, "SILENCE_SECONDS", 0.05)
    http = start()
    work.hold.clear()
    job = submitted(http, uploaded(http))
    until(http, job["id"], "running")
    threading.Timer(0.5, http.app.state.leaving.set).start()
    assert ": nothing new" in http.get(f"/v1/jobs/{job['id']}/events").text


@pytest.mark.parametrize("last", ["x", "-1", str(2**70)])
def test_a_wrong_place_is_refused(start, uploaded, submitted, work, last):
    http = start()
    job = submitted(http, uploaded(http))
    answer = http.get(f"/v1/jobs/{job['id']}/events", headers={"Last-Event-ID": last})
    assert (answer.status_code, answer.json()["field"]) == (422, "last-event-id")


def test_no_such_job(start, work):
    http = start()
    assert http.get(f"/v1/jobs/job-{20 * '0'}/events").status_code == 404

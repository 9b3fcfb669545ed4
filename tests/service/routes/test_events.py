"""/v1/jobs/{id}/events and /v1/events: every change once, in order, from where the client was, and an end."""

import asyncio
import json
import threading
import time
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace

import httpx
import pytest
from sqlalchemy.exc import OperationalError

from bentray_service.jobs import feed
from bentray_service.routes import events
from bentray_service.rows.ids import LOCAL, Tenant

from ...clock import Clock
from ...waiting import wait_until
from ..conftest import PATIENCE_S, refused


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(feed, "INTERVAL_SECONDS", 0.01)


def parsed(text):
    blocks = [block for block in text.split("\n\n")[:-1] if not block.startswith(":")]
    return [dict(line.split(": ", 1) for line in block.split("\n")) for block in blocks]


def once_watched(http, then, pause_s=0.0):
    """Do something, in a thread, once the feed has read the job of a stream, and after a pause."""
    watched = http.app.state.background.feed._watched

    def wait():
        wait_until(lambda: any(one.row for one in tuple(watched.values())))
        time.sleep(pause_s)
        then()

    threading.Thread(target=wait).start()


def test_a_job_from_its_beginning_to_its_end(http, running, work):
    here = f"/v1/jobs/{running(http)['id']}/events"
    once_watched(http, work.hold.set)
    answer = http.get(here)
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
    later = http.get(here, headers={"Last-Event-ID": str(states[1][0])})
    assert [change["state"] for change in changes_in(later)] == ["succeeded"]
    assert http.get(here, headers={"Last-Event-ID": str(states[2][0])}).text == ""
    for last in ("x", "-1", str(2**70)):
        refused(http.get(here, headers={"Last-Event-ID": last}), "last-event-id")


def test_it_ends_when_the_service_leaves(http, running, monkeypatch):
    told_ends = []

    async def told_only(watched, _seconds):
        async with asyncio.timeout(PATIENCE_S):
            await watched._news.wait()
            told_ends.append(http.app.state.leaving.is_set())

    # It does not find out at its next comment.
    monkeypatch.setattr(feed.Watched, "wait_for_change", told_only)
    job = running(http)
    # By then it has sent what it has read.
    once_watched(http, http.app.state.leaving.set, 0.2)
    told = parsed(http.get(f"/v1/jobs/{job['id']}/events").text)
    states = [json.loads(one["data"])["state"] for one in told if one["event"] == "state"]
    assert states == ["queued", "running"]
    assert told_ends[-1]


def test_heartbeats_are_sent(serve, running, work, monkeypatch):
    monkeypatch.setattr(events, "SILENCE_SECONDS", 0.05)
    with httpx.Client(base_url=serve(), timeout=60.0) as http:
        with http.stream("GET", f"/v1/jobs/{running(http)['id']}/events") as answer:
            assert ": keep-alive" in answer.iter_lines()
        work.hold.set()


def test_event_streams_share_one_query(http, uploaded, submitted, until, work, monkeypatch):
    state, looks, threads = http.app.state, [], set()
    news = state.stores.jobs.__class__.updates

    def counted(self, known):
        looks.append(set(known))
        threads.add(threading.get_ident())
        return news(self, known)

    monkeypatch.setattr(feed, "INTERVAL_SECONDS", 0.2)
    monkeypatch.setattr("bentray_service.rows.jobs.Jobs.updates", counted)
    work.hold.clear()
    dataset = uploaded(http)
    jobs = [submitted(http, dataset)["id"] for _ in range(3)]
    until(http, jobs[0], "running")
    before, begun, told = len(looks), time.monotonic(), {}
    listeners = [
        threading.Thread(target=lambda n=n: told.update({n: http.get(f"/v1/jobs/{jobs[n % 3]}/events").text}))
        for n in range(30)
    ]
    for one in listeners:
        one.start()
    wait_until(lambda: any(len(known) == 3 for known in looks))
    time.sleep(0.6)
    work.hold.set()
    for one in listeners:
        one.join(60.0)
    seconds = time.monotonic() - begun
    # Not one each: as many as one would need, and a few for those who came in between.
    assert len(looks) - before <= seconds / 0.05 + 5
    assert {len(known) for known in looks} <= {1, 2, 3}
    ends = {json.loads(parsed(text)[-1]["data"])["state"] for text in told.values()}
    assert (len(told), ends) == (30, {"succeeded"})


def test_streams_are_bounded_for_a_tenant_and_in_all(serve, monkeypatch, running, work):
    monkeypatch.setattr(feed, "OF_ACCOUNT", 3)
    with httpx.Client(base_url=serve(), timeout=60.0) as http, ExitStack() as stack:
        job = running(http)
        place = f"/v1/jobs/{job['id']}/events"
        streams = [stack.enter_context(http.stream("GET", place)) for _ in range(3)]
        assert [one.status_code for one in streams] == [200, 200, 200]
        answer = http.get(place)
        assert (answer.status_code, answer.json()["type"]) == (429, "/problems/too-many-streams")
        assert int(answer.headers["retry-after"]) > 0
        assert f"GET /v1/jobs/{job['id']}" in answer.json()["accepted"]
        streams[0].close()
        monkeypatch.setattr(feed, "IN_ALL", 3)
        wait_until(lambda: opens(http, place))
        work.hold.set()


def opens(http, place):
    with http.stream("GET", place) as answer:
        return answer.status_code == 200


def test_unavailable_database_ends_no_stream(http, running, work, monkeypatch):
    job = running(http)
    news, failures = http.app.state.stores.jobs.__class__.updates, iter(range(5))

    def fails_at_first(self, known):
        if next(failures, None) is not None:
            raise OperationalError("SELECT", {}, Exception("database is locked"))
        work.hold.set()
        return news(self, known)

    monkeypatch.setattr("bentray_service.rows.jobs.Jobs.updates", fails_at_first)
    told = parsed(http.get(f"/v1/jobs/{job['id']}/events").text)
    assert json.loads(told[-1]["data"])["state"] == "succeeded"


def changes_in(answer):
    return [json.loads(one["data"]) for one in parsed(answer.text)]


@contextmanager
def all_events(http, monkeypatch):
    """What a stream of all jobs tells in the block, and what the feed knows, which has read once before."""
    # Streams end when the test lets the clock go on.
    clock, told, watched = Clock(), {}, http.app.state.background.feed._tenants
    with monkeypatch.context() as patch:
        patch.setattr(events, "time", SimpleNamespace(monotonic=clock))
        patch.setattr(events, "SILENCE_SECONDS", 0.05)
        listener = threading.Thread(target=lambda: told.update(all=http.get("/v1/events?seconds=1")))
        listener.start()
        wait_until(lambda: LOCAL in watched and watched[LOCAL].newest is not None)
        yield told, watched[LOCAL]
        clock.now = 2.0
        listener.join(60.0)


def test_all_jobs_from_one_stream(http, uploaded, submitted, until, work, monkeypatch):
    work.hold.clear()
    dataset = uploaded(http)
    first, second = (submitted(http, dataset)["id"] for _ in range(2))
    until(http, first, "running")
    with all_events(http, monkeypatch) as (told, known):
        third = submitted(http, dataset)["id"]
        wait_until(lambda: third in known.unfinished())
        work.hold.set()
        wait_until(lambda: not known.unfinished())
    answer = told["all"]
    assert answer.headers["content-type"].startswith("text/event-stream")
    assert answer.headers["cache-control"] == "no-store"
    changes = changes_in(answer)
    assert {one["id"] for one in changes} == {first, second, third}
    for job in (first, second, third):
        mine = [one for one in changes if one["id"] == job]
        assert mine[-1] == {
            "id": job,
            "state": "succeeded",
            "progress": {"done": 24, "total": 24, "phase": ""},
        }
        assert mine == [one for k, one in enumerate(mine) if not k or one != mine[k - 1]]
    # What is over is not listed to who comes later.
    assert changes_in(http.get("/v1/events?seconds=1")) == []


def test_a_job_between_two_queries_is_not_missed(start, uploaded, submitted, until, work, monkeypatch):
    monkeypatch.setattr(feed, "INTERVAL_SECONDS", 1.0)
    http = start()
    dataset = uploaded(http)
    with all_events(http, monkeypatch) as (told, known):
        before = known.newest
        job = submitted(http, dataset)["id"]
        until(http, job)
        wait_until(lambda: known.newest != before)
    assert changes_in(told["all"])[-1]["state"] == "succeeded"


def test_jobs_of_another_tenant_are_not_in_the_stream(http, uploaded, submitted, work):
    work.hold.clear()
    job = submitted(http, uploaded(http))["id"]
    state = http.app.state
    assert [row.id for row in state.stores.jobs.changes(LOCAL, None, [])[1]] == [job]
    assert state.stores.jobs.changes(Tenant("other"), None, [job]) == (0, [])
    work.hold.set()

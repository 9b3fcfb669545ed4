"""The runner: jobs in order, a few at a time, each to its end."""

import errno
import shutil
import threading
import time

import numpy as np
import pytest
from distributed.client import FutureCancelledError
from distributed.comm import CommClosedError
from sqlalchemy.exc import DataError, OperationalError

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.settings import Settings
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_service.rows.job_queue import Queue
from bentray_service.rows.jobs import NewJob

from ...waiting import wait_until


def test_at_most_so_many_at_a_time(start, uploaded, submitted, until, work):
    http = start(jobs_at_once=2)
    dataset = uploaded(http)
    work.hold.clear()
    made = [submitted(http, dataset)["id"] for _ in range(4)]
    for job_id in made[:2]:
        until(http, job_id, "running")
    time.sleep(0.2)
    assert [http.get(f"/v1/jobs/{job_id}").json()["state"] for job_id in made[2:]] == ["queued", "queued"]
    work.hold.set()
    assert [until(http, job_id)["state"] for job_id in made] == ["succeeded"] * 4


def test_one_short_job_starts_beside_as_many_as_may(start, uploaded, submitted, until, work, cluster):
    """Which is short, the plan says: of the same tenant, too, and whatever was submitted before it."""
    http = start(jobs_at_once=2)
    dataset = uploaded(http)
    work.hold.clear()
    long = {"nodes": 512, "iterations": 1000}
    jobs = [submitted(http, dataset, **long)["id"] for _ in range(3)]
    until_states(http, jobs, "running", "running", "queued")
    jobs += [submitted(http, dataset)["id"] for _ in range(2)]
    time.sleep(0.2)
    # The workers have no lane for it.
    until_states(http, jobs, "running", "running", "queued", "queued", "queued")
    cluster.lanes = {"recon": 1, "render": 1, "short": 1}
    http.app.state.background.runner.notify()
    until_states(http, jobs, "running", "running", "queued", "running", "queued")
    http.post(f"/v1/jobs/{jobs[0]}/cancel")
    until_states(http, jobs, "cancelled", "running", "running", "running", "queued")
    work.hold.set()
    until_states(http, jobs, "cancelled", *["succeeded"] * 4)


def states_of(http, jobs):
    return [http.app.state.background.runner.queue.state(job) for job in jobs]


def until_states(http, jobs, *wanted):
    wait_until(lambda: tuple(states_of(http, jobs)) == wanted)


def test_job_of_another_tenant_starts_during_long_jobs(start, uploaded, work):
    """Of one tenant as many run as may at a time, of each other one in any case, up to so many in all."""
    http = start(jobs_at_once=2, tenants_at_once=4)
    dataset, state = uploaded(http), http.app.state
    settings, mine = (
        Settings(method="sart", nodes=16, iterations=1).to_dict(),
        state.stores.files.of(LOCAL).dataset(dataset),
    )
    for tenant in "abcd":
        its = state.stores.files.of(Tenant(tenant)).dataset(dataset)
        shutil.copy(mine, its)
        state.stores.files.store.publish(its)

    def add(tenant):
        job = state.stores.jobs.add(Tenant(tenant), NewJob("reconstruction", settings, dataset)).id
        state.background.runner.notify()
        return job

    work.hold.clear()
    jobs = [add("a") for _ in range(3)]
    until_states(http, jobs, "running", "running", "queued")
    jobs += [add("b"), add("b")]
    until_states(http, jobs, "running", "running", "queued", "running", "queued")
    jobs += [add("c"), add("d")]
    until_states(http, jobs, "running", "running", "queued", "running", "queued", "running", "queued")
    assert state.background.runner.alive()
    state.stores.jobs.request_cancel(Tenant("c"), jobs[5])
    until_states(http, jobs, "running", "running", "queued", "running", "queued", "cancelled", "running")
    work.hold.set()
    until_states(http, jobs, *["succeeded"] * 5, "cancelled", "succeeded")


def test_new_job_starts_at_once(start, uploaded, submitted, until, work, monkeypatch):
    monkeypatch.setattr("bentray_service.jobs.runner.Runner.idle_s", 600.0)
    http = start(jobs_at_once=1)
    dataset = uploaded(http)
    time.sleep(0.1)  # by now it has looked and waits
    assert until(http, submitted(http, dataset)["id"])["state"] == "succeeded"


def test_a_job_that_begins_while_the_service_stops_is_put_back(http, uploaded, submitted, work, monkeypatch):
    state, claimed, claim = http.app.state, threading.Event(), Queue.claim

    def late(self, *args, **kwargs):
        job = claim(self, *args, **kwargs)
        if job is not None:
            claimed.set()
            # Until the service has begun to stop.
            state.background.runner._leaving.wait(60.0)
            time.sleep(0.1)
        return job

    work.hold.clear()
    dataset = uploaded(http)
    monkeypatch.setattr(Queue, "claim", late)
    job = submitted(http, dataset)
    assert claimed.wait(60.0)
    state.background.runner.stop()
    assert state.background.runner.queue.state(job["id"]) == "queued"


def test_cancel_a_running_job(http, running, until):
    job = running(http)
    answer = http.post(f"/v1/jobs/{job['id']}/cancel")
    assert answer.status_code == 202
    assert answer.json()["state"] in ("cancelling", "cancelled")
    done = until(http, job["id"])
    assert (done["state"], done["volume"]) == ("cancelled", None)
    assert not list((http.app.state.stores.files.of(LOCAL).root / "volumes").iterdir())


@pytest.mark.parametrize(
    ("error", "spoil", "field", "found"),
    [
        (
            InvalidInput("traveltime", "every pair missing", "a pair"),
            None,
            "traveltime",
            "every pair missing",
        ),
        (None, np.nan, "settings", "no finite speed at 1 nodes"),
    ],
)
def test_a_refused_job_says_why(http, uploaded, submitted, until, work, error, spoil, field, found):
    work.error, work.spoil = error, spoil
    done = until(http, submitted(http, uploaded(http))["id"])
    assert (done["state"], done["error"]["field"]) == ("failed", field)
    assert found in done["error"]["found"]
    assert done["progress"] == {"done": 24, "total": 24, "phase": ""}


def test_the_next_job_runs_after_a_failure(start, uploaded, submitted, until, work):
    http = start(jobs_at_once=1)
    dataset = uploaded(http)
    work.error = OSError(errno.ENOSPC, "full")
    first = until(http, submitted(http, dataset)["id"])
    assert "disk" in first["error"]["detail"]
    work.error = None
    assert until(http, submitted(http, dataset)["id"])["state"] == "succeeded"


def test_the_end_is_stored_once_the_database_is_back(http, uploaded, submitted, until, work, monkeypatch):
    queue, store = http.app.state.background.runner.queue, Queue.succeed
    tries = []

    def away_at_first(*given):
        tries.append(given)
        if len(tries) == 1:
            raise OperationalError("update", {}, Exception("database is locked"))
        return store(queue, *given)

    monkeypatch.setattr(queue, "succeed", away_at_first)
    assert until(http, submitted(http, uploaded(http))["id"])["state"] == "succeeded"
    assert len(tries) == 2


def test_progress_is_seen_while_it_runs(http, running, until, work):
    job = running(http)
    wait_until(lambda: http.get(f"/v1/jobs/{job['id']}").json()["progress"]["total"])
    work.hold.set()
    assert until(http, job["id"])["progress"]["done"] == 24


def test_a_full_disk_is_waited_for(start, uploaded, submitted, until, work, monkeypatch):
    http = start(jobs_at_once=1)
    dataset = uploaded(http)
    runner = http.app.state.background.runner
    room, answers = [True], []

    def has_room():
        answers.append(room[0])
        return answers[-1]

    monkeypatch.setattr(runner, "_has_free_space", has_room)
    work.hold.clear()
    work.error = OSError(errno.ENOSPC, "full")
    job = submitted(http, dataset)
    until(http, job["id"], "running")
    room[0] = False
    # A look at the disk that began before it was full may still lead to a claim.
    wait_until(lambda: not answers[-1] or runner.notify())
    work.hold.set()
    until(http, job["id"], "queued")
    time.sleep(0.1)
    assert len(work.calls) == 1
    work.error, room[0] = None, True
    runner.notify()
    assert until(http, job["id"])["state"] == "succeeded"
    notes = [event.note for event in http.app.state.stores.jobs.updates({job["id"]: 0})[1][job["id"]]]
    assert notes[2] == "the disk is full; the job continues once there is space"


@pytest.mark.parametrize("error", [CommClosedError("gone"), FutureCancelledError("key", "lost")])
def test_lost_scheduler_fails_no_job(start, running, until, work, error):
    http = start(jobs_at_once=1)
    work.error = error
    job = running(http)
    work.hold.set()
    until(http, job["id"], "queued")
    work.error = None
    assert until(http, job["id"])["state"] == "succeeded"
    notes = {event.note for event in http.app.state.stores.jobs.updates({job["id"]: 0})[1][job["id"]]}
    assert "no answer from the workers; the job continues when available" in notes


def test_finished_jobs_leave_no_temporary_files(http, uploaded, submitted, until, work):
    folder = http.app.state.stores.files.of(LOCAL).root / "work"
    work.hold.clear()
    job = submitted(http, uploaded(http))
    # It is running a moment before its folder is there.
    wait_until(lambda: work.calls)
    assert [left.name for left in folder.iterdir()] == [job["id"]]
    work.hold.set()
    until(http, job["id"])
    wait_until(lambda: not list(folder.iterdir()))


def test_a_full_queue_is_a_429(start, running, submitted, work):
    http = start(jobs_at_once=1, max_queued_jobs=1)
    dataset = running(http)["dataset"]
    submitted(http, dataset)
    answer = http.post("/v1/jobs", json={"kind": "reconstruction", "dataset": dataset})
    assert (answer.status_code, answer.json()["type"]) == (429, "/problems/queue-full")
    assert int(answer.headers["Retry-After"]) > 0
    work.hold.set()


def test_unrecordable_result_fails_the_job(start, uploaded, submitted, until, work, monkeypatch):
    monkeypatch.setattr("bentray_service.jobs.runner.Runner.idle_s", 0.05)
    http = start(jobs_at_once=1)

    def refused(*given):
        raise DataError("insert", {}, Exception("invalid input syntax for type json"))

    dataset = uploaded(http)
    with monkeypatch.context() as patch:
        patch.setattr(http.app.state.background.runner.queue, "succeed", refused)
        done = until(http, submitted(http, dataset)["id"])
    assert (done["state"], done["error"]["type"]) == ("failed", "/problems/internal")
    assert until(http, submitted(http, dataset)["id"])["state"] == "succeeded", "the slot is free again"

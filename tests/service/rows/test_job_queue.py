"""The queue: jobs claimed in order and by turns, their states, leases and ends."""

import math
import time
from types import SimpleNamespace

import pytest

from bentray_service.errors import UnknownId
from bentray_service.rows import usage
from bentray_service.rows.ids import LOCAL, Tenant, volume_of
from bentray_service.rows.job_queue import LEASE_S, Queue
from bentray_service.rows.jobs import NewJob
from bentray_service.rows.projects import Projects
from bentray_service.rows.stored_tables import Volumes

from .conftest import at_once, volume_row

PROBLEM = {"type": "/problems/x", "title": "t", "status": 500, "detail": "why"}


def test_no_job_is_claimed_twice(jobs, queue, dataset):
    made = {jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id for _ in range(12)}
    taken = at_once(lambda _: list(iter(queue.claim, None)), 4)
    claimed = [job.id for jobs_of_one in taken for job in jobs_of_one]
    assert len(claimed) == 12
    assert set(claimed) == made


def test_success_comes_with_its_volume(database, jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {"nodes": 16}, dataset))
    queue.claim()
    queue.progress(job.id, 4, 4, [{"slice": 0, "sweep": 1, "residual_rms_s": None, "emitters": 4}])
    assert queue.succeed(job.id, volume_row(job.id))
    row = jobs.get(LOCAL, job.id)
    assert (row.state, row.done, row.history[0]["emitters"]) == ("succeeded", 4, 4)
    assert row.finished >= row.started
    assert Volumes(database).get(LOCAL, volume_of(job.id)).dataset_id == dataset
    assert [event.state for event in jobs.updates({job.id: 0})[1][job.id]] == [
        "queued",
        "running",
        "succeeded",
    ]


def test_a_cancelled_job_cannot_succeed(database, jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    queue.claim()
    assert jobs.request_cancel(LOCAL, job.id).state == "cancelling"
    assert not queue.succeed(job.id, volume_row(job.id))
    with pytest.raises(UnknownId):
        Volumes(database).get(LOCAL, volume_of(job.id))
    queue.mark_cancelled(job.id)
    assert queue.state(job.id) == "cancelled"


def test_failure_keeps_the_reason(jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    queue.claim()
    queue.fail(job.id, PROBLEM)
    assert jobs.get(LOCAL, job.id).error == PROBLEM
    assert jobs.updates({job.id: 0})[1][job.id][-1].note == "why"


def test_release_is_no_attempt(jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    queue.claim()
    queue.progress(job.id, 3, 9, [])
    queue.release(job.id, "a reason")
    row = jobs.get(LOCAL, job.id)
    assert (row.state, row.attempts, row.started) == ("queued", 0, None)
    again = queue.claim()
    assert (again.done, again.total) == (3, 9), "it resumes from its checkpoint"


def test_a_job_that_kills_the_service_is_given_up(database, jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    ends = []
    for _ in range(3):
        Queue(database, "folder").claim()
        Queue(database, "folder").recover(PROBLEM)
        ends.append(queue.state(job.id))
    assert ends == ["queued", "queued", "failed"]


def test_job_with_progress_is_retried(database, jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    for _ in range(8):
        dying = Queue(database, "folder")
        assert dying.claim().id == job.id
        dying.reset_attempts(job.id)
        assert Queue(database, "folder").recover(PROBLEM) == 1
    assert jobs.get(LOCAL, job.id).attempts == 1
    assert [event.state for event in jobs.updates({job.id: 0})[1][job.id]] == [
        "queued",
        *8 * ["running", "queued"],
    ]


def test_a_service_takes_over_the_jobs_of_its_data_folder_at_once_and_no_others(database, jobs, dataset):
    made = {
        name: jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id for name in ("one", "one_", "other")
    }
    for name in made:
        Queue(database, name).claim()
    again = Queue(database, "one")
    assert again.recover(PROBLEM) == 1
    assert [again.state(job) for job in made.values()] == ["queued", "running", "running"]
    assert again.claim().id == made["one"]
    assert again.recover(PROBLEM) == 0, "its own job is at work"


def test_the_longest_queues_are_those_of_accounts_with_their_projects(database, jobs, queue, dataset):
    project = Projects(database).add(LOCAL, "Trial", None).id
    for tenant, number in ((LOCAL, 2), (project, 2), ("b", 3), ("c", 1)):
        for _ in range(number):
            jobs.add(tenant, NewJob("reconstruction", {}, dataset))
    queue.claim()
    found = queue.longest(2)
    assert {account for account, _ in found} == {LOCAL, "b"}
    assert sum(number for (account, _), number in found.items() if account == LOCAL) == 4
    with database.write() as connection:
        for tenant, size in ((LOCAL, 5), (project, 7), ("b", 20), ("c", 1)):
            usage.store(connection, Tenant(tenant), "x", size)
        assert usage.largest(connection, 2) == {"b": 20, LOCAL: 1 + 5 + 7}, "with the dataset"


def test_second_service_claims_only_expired_jobs(database, jobs, queue, dataset, monkeypatch):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    other = Queue(database)
    other.claim()
    assert queue.recover(PROBLEM) == 0
    later = time.time() + LEASE_S + 1.0
    monkeypatch.setattr("bentray_service.rows.job_queue.time", SimpleNamespace(time=lambda: later))
    other.renew([job.id])
    assert queue.recover(PROBLEM) == 0
    monkeypatch.setattr(
        "bentray_service.rows.job_queue.time", SimpleNamespace(time=lambda: later + LEASE_S + 1.0)
    )
    assert other.recover(PROBLEM, held=[job.id]) == 0, "its own job is at work"
    assert queue.recover(PROBLEM) == 1
    assert queue.claim().id == job.id
    # The first one wakes up and has lost its job.
    assert other.held_state(job.id) is None
    other.progress(job.id, 7, 9, [])
    other.fail(job.id, PROBLEM)
    other.release(job.id, "late")
    assert not other.succeed(job.id, volume_row(job.id))
    row = jobs.get(LOCAL, job.id)
    assert (row.state, row.done, queue.held_state(job.id)) == ("running", 0, "running")
    assert queue.succeed(job.id, volume_row(job.id))


def test_lost_claim_is_reclaimed(jobs, queue, dataset, monkeypatch):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    queue.claim()
    queue.renew([])
    assert queue.recover(PROBLEM) == 0, "it may be on its way"
    later = time.time() + LEASE_S + 1.0
    monkeypatch.setattr("bentray_service.rows.job_queue.time", SimpleNamespace(time=lambda: later))
    assert queue.recover(PROBLEM) == 1
    assert queue.claim().id == job.id


def test_tenants_take_turns(jobs, queue, dataset):
    for tenant, count in (("a", 5), ("b", 2), ("c", 1)):
        for _ in range(count):
            jobs.add(tenant, NewJob("reconstruction", {}, dataset))
    order = []
    for _ in range(8):
        job = queue.claim()
        order.append(job.tenant)
        queue.fail(job.id, PROBLEM)
        # A clock too coarse to tell two starts apart would leave the order to the numbers.
        time.sleep(0.002)
    assert order == ["a", "b", "c", "a", "b", "a", "a", "a"]
    for _ in range(3):
        jobs.add(Tenant("a"), NewJob("reconstruction", {}, dataset))
    jobs.add(Tenant("b"), NewJob("reconstruction", {}, dataset))
    assert [queue.claim().tenant for _ in range(3)] == ["b", "a", "a"]


def test_claim_can_be_limited_to_idle_tenants(jobs, queue, dataset):
    for tenant in ("a", "a", "b"):
        jobs.add(Tenant(tenant), NewJob("reconstruction", {}, dataset))
    assert queue.claim(idle_only=True).tenant == "a"
    job = queue.claim(idle_only=True)
    assert job.tenant == "b"
    assert queue.claim(idle_only=True) is None
    queue.fail(job.id, PROBLEM)
    assert queue.claim(idle_only=True) is None
    assert queue.claim().tenant == "a"


def test_a_job_on_a_volume_ends_without_one(jobs, queue, database):
    job = jobs.add(LOCAL, NewJob("refraction", {"frames": 3}, volume_id="vol-" + "0" * 20))
    assert (job.dataset_id, job.volume_id) == (None, "vol-" + "0" * 20)
    queue.claim()
    assert queue.succeed(job.id, None)
    assert queue.state(job.id) == "succeeded"
    with pytest.raises(UnknownId):
        Volumes(database).get(LOCAL, volume_of(job.id))


def test_a_result_with_numbers_that_json_has_not_is_null_there(jobs, queue, dataset, database):
    job = jobs.add(LOCAL, NewJob("reconstruction", {"weight": math.inf}, dataset))
    queue.claim()
    result = volume_row(job.id)
    result |= {"speed_range_mps": [math.nan, 1500.0], "provenance": {"fit": {"rms": -math.inf, "n": 3}}}
    queue.progress(job.id, 1, 2, [{"residual_rms_s": math.nan}])
    assert queue.succeed(job.id, result)
    row = jobs.get(LOCAL, job.id)
    assert (row.state, row.settings, row.history) == (
        "succeeded",
        {"weight": None},
        [{"residual_rms_s": None}],
    )
    kept = Volumes(database).get(LOCAL, volume_of(job.id))
    assert (kept.speed_range_mps, kept.provenance) == ([None, 1500.0], {"fit": {"rms": None, "n": 3}})

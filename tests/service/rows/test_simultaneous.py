"""Simultaneous writes on every database: one job per key and one end per job."""

from collections import Counter

import pytest

from bentray_service.errors import InUse, JobFinished, KeyReused, UnknownId
from bentray_service.files.data_folder import Files
from bentray_service.files.deletion import Deletion
from bentray_service.rows import database as admission
from bentray_service.rows.ages import StoredItem
from bentray_service.rows.ids import LOCAL
from bentray_service.rows.jobs import NewJob, Submission
from bentray_service.rows.tables import JobRow

from .conftest import at_once

AT_ONCE = 50


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """More threads than a service has, on a machine that may be slow, are not to be sent away here."""
    monkeypatch.setattr(admission, "MAX_CONCURRENT", AT_ONCE)
    monkeypatch.setattr(admission, "SLOW_SECONDS", 60.0)


def together(ask):
    return at_once(ask, AT_ONCE, JobFinished, InUse, KeyReused, UnknownId)


def states(jobs, job_id):
    return [event.state for event in jobs.updates({job_id: 0})[1][job_id]]


def test_one_key_makes_one_job(jobs, dataset):
    made = together(
        lambda _: jobs.add(LOCAL, NewJob("reconstruction", {"nodes": 16}, dataset), Submission(key="once"))
    )
    assert len({job.id for job in made}) == 1
    assert len(jobs.newest(LOCAL, 2 * AT_ONCE)) == 1
    assert states(jobs, made[0].id) == ["queued"]


def test_a_key_for_several_requests_is_the_firsts(jobs, dataset):
    made = together(
        lambda n: jobs.add(
            LOCAL, NewJob("reconstruction", {"nodes": 16 + n % 2}, dataset), Submission(key="once")
        )
    )
    refused = [one for one in made if isinstance(one, KeyReused)]
    assert len(refused) == AT_ONCE // 2
    assert len(jobs.newest(LOCAL, 2 * AT_ONCE)) == 1


def test_without_keys_each_makes_its_own(jobs, dataset):
    made = together(lambda _: jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)))
    assert len({job.id for job in made}) == AT_ONCE


def test_a_scan_is_deleted_or_has_jobs(jobs, database, dataset, tmp_path):
    files = Files(tmp_path / "data")
    files.prepare()
    deletion = Deletion(database, files)

    def ask(number):
        if number == AT_ONCE // 2:
            return deletion.delete(StoredItem(LOCAL, "dataset", dataset))
        return jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))

    told = together(ask)
    deleted = told.pop(AT_ONCE // 2) is None
    assert {type(one) for one in told} == ({UnknownId} if deleted else {JobRow})
    assert len(jobs.newest(LOCAL, AT_ONCE)) == (0 if deleted else AT_ONCE - 1)


def test_a_queued_job_is_cancelled_once(jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id
    told = Counter(type(one) for one in together(lambda _: jobs.request_cancel(LOCAL, job)))
    assert told == {JobRow: 1, JobFinished: AT_ONCE - 1}
    assert states(jobs, job) == ["queued", "cancelled"]
    assert queue.claim() is None


def test_running_job_is_cancelled_once(jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id
    assert queue.claim().id == job
    told = together(lambda _: jobs.request_cancel(LOCAL, job).state)
    assert told == ["cancelling"] * AT_ONCE
    assert states(jobs, job) == ["queued", "running", "cancelling"]


@pytest.mark.parametrize("end", ["succeed", "cancelled"])
def test_a_job_that_ends_while_it_is_cancelled_has_one_end(jobs, queue, dataset, end):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id
    queue.claim()

    def ask(number):
        if number:
            return jobs.request_cancel(LOCAL, job)
        return queue.succeed(job, None) if end == "succeed" else queue.mark_cancelled(job)

    together(ask)
    if jobs.get(LOCAL, job).state == "cancelling":
        queue.mark_cancelled(job)
    told = states(jobs, job)
    assert len([state for state in told if state in ("succeeded", "cancelled")]) == 1
    assert len(told) == len(set(told))

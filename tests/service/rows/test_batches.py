"""Batches: all jobs or none, state and progress of their jobs, and an end with the last of them."""

import pytest
from sqlalchemy import update

from bentray_service.errors import JobFinished, KeyReused, QueueFull, QuotaExceeded, UnknownId
from bentray_service.rows.batches import Batches
from bentray_service.rows.ids import LOCAL, Tenant, new_id
from bentray_service.rows.jobs import NewJob, Submission
from bentray_service.rows.tables import JobRow


@pytest.fixture
def batches(database):
    return Batches(database)


def start(batches, dataset, number=3, tenant=LOCAL, **how):
    new = [NewJob("reconstruction", {"nodes": one}, dataset, reserved=10) for one in range(number)]
    return batches.add(tenant, "Ward 3", {"nodes": 8}, new, Submission(**how))


def put(database, jobs, **values):
    with database.write() as connection:
        connection.execute(update(JobRow).where(JobRow.id.in_(jobs)).values(**values))


def test_its_jobs_are_ordinary_jobs_in_order(batches, jobs, queue, dataset):
    batch = start(batches, dataset, started_by="key-7")
    ids = [job.id for job in batch.jobs]
    assert [row.settings["nodes"] for row in (jobs.get(LOCAL, one) for one in ids)] == [0, 1, 2]
    assert {row.id for row in jobs.search(LOCAL, 9, batch_id=batch.id)} == set(ids)
    assert [queue.claim().id for _ in ids] == ids
    assert (batch.state, batch.fraction, batch.size, batch.name) == ("queued", 0.0, 3, "Ward 3")
    assert jobs.get(LOCAL, ids[0]).started_by == "key-7"
    assert jobs.get(LOCAL, jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id).batch_id is None


def test_state_and_progress_are_those_of_its_jobs(batches, database, dataset):
    batch = start(batches, dataset)
    one, two, three = (job.id for job in batch.jobs)

    def now():
        found = batches.get(LOCAL, batch.id)
        return found.state, round(found.fraction, 4), found.finished

    put(database, [one], state="running", started=5.0, done=3, total=4, phase="picking")
    # Another phase counts by itself.
    assert now() == ("running", 0.0, None)
    put(database, [one], phase="reconstructing")
    assert now() == ("running", 0.25, None)
    put(database, [one], state="succeeded", finished=9.0)
    # Between two jobs it does not wait.
    assert now() == ("running", 0.3333, None)
    put(database, [two, three], state="cancelling", started=7.0)
    assert now()[0] == "cancelling"
    put(database, [two], state="failed", finished=11.0)
    put(database, [three], state="cancelled", finished=10.0)
    assert now() == ("failed", 1.0, 11.0)
    put(database, [two], state="succeeded")
    assert now()[0] == "cancelled"
    put(database, [three], state="succeeded")
    found = batches.newest(LOCAL, 5)[0]
    assert (found.state, found.started, found.counts) == ("succeeded", 5.0, {"succeeded": 3})


@pytest.mark.parametrize(
    ("how", "error"),
    [({"most_queued": 2}, QueueFull), ({"most_bytes": 25}, QuotaExceeded), ({}, UnknownId)],
)
def test_all_jobs_or_none(batches, jobs, dataset, how, error):
    with pytest.raises(error):
        start(batches, dataset if how else new_id("dataset"), **how)
    assert jobs.newest(LOCAL, 9) == batches.newest(LOCAL, 9) == []


def test_a_repeated_request_starts_no_second_batch(batches, jobs, dataset):
    first = start(batches, dataset, key="k")
    assert start(batches, dataset, key="k").id == first.id
    assert len(jobs.newest(LOCAL, 9)) == 3
    with pytest.raises(KeyReused):
        start(batches, dataset, number=2, key="k")


def test_cancel_ends_what_has_not_ended(batches, jobs, queue, dataset):
    batch = start(batches, dataset)
    claimed = queue.claim().id
    found = batches.request_cancel(LOCAL, batch.id)
    assert (found.state, found.counts) == ("cancelling", {"cancelling": 1, "cancelled": 2})
    queue.mark_cancelled(claimed)
    assert batches.get(LOCAL, batch.id).state == "cancelled"
    with pytest.raises(JobFinished):
        batches.request_cancel(LOCAL, batch.id)


def test_other_tenants_know_nothing_of_it(batches, dataset):
    batch, other = start(batches, dataset), Tenant("other")
    for use in (batches.get, batches.request_cancel):
        with pytest.raises(UnknownId):
            use(other, batch.id)
    assert batches.newest(other, 9) == []
    assert batches.get(LOCAL, batch.id).state == "queued"

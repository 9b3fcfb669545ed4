"""Names and notes of scans and jobs, who started a job, and its place in the queue."""

import pytest

from bentray_service.errors import UnknownId
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_service.rows.jobs import NewJob, Submission
from bentray_service.rows.stored_tables import Datasets

OTHER = Tenant("other")


def test_what_is_not_given_stays(database, jobs, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset), Submission(started_by="key-7"))
    assert (job.name, job.notes, job.started_by) == ("", "", "key-7")
    jobs.describe(LOCAL, job.id, name="First", notes="Cold water")
    assert jobs.describe(LOCAL, job.id).values() == jobs.get(LOCAL, job.id).values()
    jobs.describe(LOCAL, job.id, name="")
    assert jobs.get(LOCAL, job.id).values() == {**job.values(), "notes": "Cold water"}
    scans = Datasets(database)
    before = scans.get(LOCAL, dataset)
    assert scans.describe(LOCAL, dataset, name="Left").values() == {**before.values(), "name": "Left"}


def test_only_the_item_of_the_tenant_is_changed(database, jobs, dataset):
    mine, second = (jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)) for _ in range(2))
    for table, item in ((jobs, mine.id), (Datasets(database), dataset)):
        with pytest.raises(UnknownId):
            table.describe(OTHER, item, name="theirs")
        assert table.get(LOCAL, item).name == ""
    jobs.describe(LOCAL, mine.id, name="First")
    assert jobs.get(LOCAL, second.id).values() == second.values()


def test_the_place_in_the_queue_is_the_order_of_claims(jobs, queue, dataset):
    """Tenants take turns; every place that is told is the number of claims before the job's own."""
    owners = [LOCAL, LOCAL, LOCAL, OTHER, Tenant("third"), OTHER, LOCAL]
    waiting = [jobs.add(owner, NewJob("reconstruction", {}, dataset)) for owner in owners]
    # So that the tenants differ in when their last job started.
    for _ in range(2):
        claimed = queue.claim()
        queue.fail(claimed.id, {"detail": "ended"})
        waiting = [job for job in waiting if job.id != claimed.id]
        assert jobs.place(jobs.get(claimed.tenant, claimed.id)) is None
    told = {job.id: jobs.place(job) for job in waiting}
    order = []
    while (claimed := queue.claim()) is not None:
        order.append(claimed.id)
        queue.fail(claimed.id, {"detail": "ended"})
    assert [told[job] for job in order] == list(range(5))

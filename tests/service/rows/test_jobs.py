"""Jobs of a tenant: newest first, search, names, idempotency keys, cancellation, places, isolation."""

import random

import pytest

from bentray_service.errors import KeyReused, QueueFull, UnknownId
from bentray_service.rows.ids import LOCAL, Tenant, new_id
from bentray_service.rows.jobs import NewJob, Submission
from bentray_service.rows.stored_tables import Datasets
from bentray_service.rows.tables import DatasetRow

from .conftest import SUMMARY


def test_newest_first_and_of_one_tenant(jobs, dataset):
    made = [jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id for _ in range(3)]
    other = Tenant("other")
    theirs = jobs.add(other, NewJob("reconstruction", {}, dataset)).id
    assert [row.id for row in jobs.newest(LOCAL, 10)] == made[::-1]
    assert [row.id for row in jobs.newest(LOCAL, 2)] == made[:0:-1]
    assert [row.id for row in jobs.newest(LOCAL, 9, before=made[1])] == made[:1]
    assert [row.id for row in jobs.newest(other, 9)] == [theirs]


def test_another_tenants_job_is_as_none(jobs, dataset):
    job, other, none = (
        jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id,
        Tenant("other"),
        "job-" + "0" * 20,
    )
    for ask in (jobs.get, jobs.request_cancel, lambda tenant, job: jobs.newest(tenant, 9, before=job)):
        told = []
        for name in (job, none, "../../x", ""):
            with pytest.raises(UnknownId) as refusal:
                ask(other, name)
            told.append(str(refusal.value).replace(name or "''", ""))
        assert told[0] == told[1]
    assert jobs.get(LOCAL, job).state == "queued"


def test_a_full_queue_refuses_of_this_tenant_alone(jobs, queue, dataset):
    def add(tenant):
        jobs.add(Tenant(tenant), NewJob("reconstruction", {}, dataset), Submission(most_queued=2))

    add("a")
    add("a")
    with pytest.raises(QueueFull, match="2 queued"):
        add("a")
    add("b")
    queue.claim()
    add("a")


def test_a_key_names_one_job_of_its_tenant(jobs, queue, dataset):
    def add(tenant, nodes):
        return jobs.add(tenant, NewJob("reconstruction", {"nodes": nodes}, dataset), Submission(key="k")).id

    mine = add(LOCAL, 16)
    assert add(LOCAL, 16) == mine
    with pytest.raises(KeyReused):
        add(LOCAL, 17)
    assert add(Tenant("b"), 17) != mine
    assert [len(jobs.search(LOCAL, 9, state=state)) for state in ("queued", "running")] == [1, 0]
    assert queue.load()[0] == {"queued": 2}


def test_the_next_place_is_that_of_the_job_submitted_next(jobs, queue, dataset):
    tenants = [Tenant(name) for name in ("a", "b", "c")]
    chance = random.Random(4)
    for _ in range(30):
        tenant = chance.choice(tenants)
        before = jobs.queue_position(tenant)
        assert jobs.place(jobs.add(tenant, NewJob("reconstruction", {}, dataset))) == before
        if chance.random() < 0.4:
            queue.claim()


def test_durations_are_those_of_one_tenant_and_kind(jobs, queue, dataset):
    other = Tenant("other")
    for tenant, kind in ((LOCAL, "reconstruction"), (LOCAL, "refraction"), (other, "reconstruction")):
        jobs.add(tenant, NewJob(kind, {}, dataset, plan={"work_s": 2.0}))
        queue.succeed(queue.claim().id, None)
    jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    queue.fail(queue.claim().id, {"detail": "no image"})
    ((plan, seconds),) = jobs.durations(LOCAL, "reconstruction", 10)
    assert plan == {"work_s": 2.0}
    assert seconds >= 0.0
    assert len(jobs.durations(other, "reconstruction", 10)) == 1
    assert jobs.durations(Tenant("third"), "reconstruction", 10) == []


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


@pytest.fixture
def titled(database, jobs):
    """Make a scan with this title and a job of it; returns the id of the job."""

    def make(tenant, title, name="", started_by=""):
        summary = {**SUMMARY, "title": title}
        row = Datasets(database).add(tenant, new_id("dataset"), size=1, sha256="0" * 64, summary=summary)
        job = jobs.add(tenant, NewJob("reconstruction", {}, row.id), Submission(started_by=started_by))
        jobs.describe(tenant, job.id, name=name)
        return job.id

    return make


def found(jobs, tenant, text):
    return [job.id for job in jobs.search(tenant, 10, text=text)]


def test_names_titles_and_owners_of_one_tenant(jobs, titled):
    mine = titled(LOCAL, "Left Breast", started_by="alice")
    theirs = titled(OTHER, "Left Breast", name="alice")
    for words in ("left", "BREAST", "t B", "alice"):
        assert found(jobs, LOCAL, words) == [mine], words
        assert found(jobs, OTHER, words) == [theirs], words
    assert found(jobs, LOCAL, theirs) == []


def test_no_character_is_a_pattern(jobs, titled):
    percent, underscore, stroke = (titled(LOCAL, title) for title in ("100 %", "a_b", "c\\d"))
    assert found(jobs, LOCAL, "%") == [percent]
    assert found(jobs, LOCAL, "_") == [underscore]
    assert found(jobs, LOCAL, "\\") == [stroke]
    assert found(jobs, LOCAL, "a%b") == found(jobs, LOCAL, "c_d") == found(jobs, LOCAL, "'") == []


def test_a_simulation_by_the_title_of_the_scan_that_it_made(database, jobs, queue):
    jobs.add(LOCAL, NewJob("simulation", {}))
    job = queue.claim()
    result = {
        **SUMMARY,
        "title": "Phantom of Table 7",
        "id": new_id("dataset"),
        "bytes": 1,
        "sha256": "0" * 64,
    }
    assert queue.succeed(job.id, result, into=DatasetRow)
    assert found(jobs, LOCAL, "table 7") == [job.id]
    assert found(jobs, LOCAL, "table 8") == []

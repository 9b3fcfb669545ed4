"""Jobs of a tenant: newest first, idempotency keys, cancellation, isolation."""

import random
import threading

import pytest

from bentray_service.errors import JobFinished, KeyReused, QueueFull, UnknownId
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_service.rows.jobs import NewJob, Submission


def test_newest_first_and_of_one_tenant(jobs, dataset):
    made = [jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id for _ in range(3)]
    other = Tenant("other")
    theirs = jobs.add(other, NewJob("reconstruction", {}, dataset)).id
    assert [row.id for row in jobs.newest(LOCAL, 10)] == made[::-1]
    assert [row.id for row in jobs.newest(LOCAL, 2)] == made[:0:-1]
    assert [row.id for row in jobs.newest(LOCAL, 9, before=made[1])] == made[:1]
    assert [row.id for row in jobs.newest(other, 9)] == [theirs]


def test_another_tenants_job_is_as_none(jobs, dataset):
    job, other = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset)).id, Tenant("other")
    assert jobs.events(other, job) == []
    for ask in (jobs.get, jobs.request_cancel, lambda tenant, job: jobs.newest(tenant, 9, before=job)):
        with pytest.raises(UnknownId) as refusal:
            ask(other, job)
        with pytest.raises(UnknownId) as unknown:
            ask(other, "job-" + "0" * 20)
        assert str(refusal.value).replace(job, "") == str(unknown.value).replace("job-" + "0" * 20, "")
    assert jobs.get(LOCAL, job).state == "queued"


def test_a_queued_job_is_cancelled_at_once(jobs, queue, dataset):
    job = jobs.add(LOCAL, NewJob("reconstruction", {}, dataset))
    assert jobs.request_cancel(LOCAL, job.id).state == "cancelled"
    assert queue.claim() is None
    with pytest.raises(JobFinished, match="cancelled"):
        jobs.request_cancel(LOCAL, job.id)


def test_a_full_queue_refuses_of_this_tenant_alone(jobs, queue, dataset):
    for _ in range(2):
        jobs.add(Tenant("a"), NewJob("reconstruction", {}, dataset), Submission(most_queued=2))
    with pytest.raises(QueueFull, match="2 queued"):
        jobs.add(Tenant("a"), NewJob("reconstruction", {}, dataset), Submission(most_queued=2))
    jobs.add(Tenant("b"), NewJob("reconstruction", {}, dataset), Submission(most_queued=2))
    queue.claim()
    jobs.add(Tenant("a"), NewJob("reconstruction", {}, dataset), Submission(most_queued=2))


@pytest.mark.parametrize("job_id", ["job-" + "0" * 20, "../../x", ""])
def test_unknown_ids(jobs, job_id):
    for ask in (jobs.get, jobs.request_cancel):
        with pytest.raises(UnknownId):
            ask(LOCAL, job_id)


def test_a_key_names_one_job_of_its_tenant(database, jobs, queue, dataset):
    made = []

    def add():
        made.append(jobs.add(LOCAL, NewJob("reconstruction", {"nodes": 16}, dataset), Submission(key="k")).id)

    threads = [threading.Thread(target=add) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(made), len(set(made))) == (6, 1)
    with pytest.raises(KeyReused):
        jobs.add(LOCAL, NewJob("reconstruction", {"nodes": 17}, dataset), Submission(key="k"))
    assert (
        jobs.add(Tenant("b"), NewJob("reconstruction", {"nodes": 17}, dataset), Submission(key="k")).id
        not in made
    )
    assert [len(jobs.search(LOCAL, 9, state=state)) for state in ("queued", "running")] == [1, 0]
    assert queue.load()[0] == {"queued": 2}


def test_the_next_place_is_that_of_the_job_submitted_next(jobs, queue, dataset):
    tenants = [Tenant(name) for name in ("a", "b", "c")]
    chance = random.Random(4)
    for _ in range(30):
        tenant = chance.choice(tenants)
        before = jobs.next_place(tenant)
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

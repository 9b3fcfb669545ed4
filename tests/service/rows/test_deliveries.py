"""Messages to webhooks: stored with the end of a job, claimed once, taken over, and in turn by tenant."""

import time
from types import SimpleNamespace

import pytest
from sqlalchemy import update

from bentray_service.rows import deliveries as module
from bentray_service.rows.deliveries import Deliveries, WebhookSecrets
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_service.rows.jobs import NewJob, Submission
from bentray_service.rows.tables import DeliveryRow

LAB = Tenant("lab")
URL = "https://example.org/hook"


@pytest.fixture
def ended(jobs):
    """Insert a job with a webhook and end it; returns its id."""

    def add(tenant=LOCAL, webhook=URL):
        job = jobs.add(tenant, NewJob("simulation", {}), Submission(webhook=webhook)).id
        jobs.request_cancel(tenant, job)
        return job

    return add


def test_one_message_for_each_job_with_a_webhook(database, jobs, ended):
    found = Deliveries(database)
    assert found.claim() is None
    waiting = jobs.add(LOCAL, NewJob("simulation", {}), Submission(webhook=URL)).id
    job, silent = ended(), ended(webhook=None)
    assert found.of_job(LOCAL, job).state == "waiting"
    assert found.of_job(LAB, job) is None
    assert found.of_job(LOCAL, waiting) is None
    assert found.of_job(LOCAL, silent) is None
    assert found.counts() == {"waiting": 1, "delivered": 0, "failed": 0}


def test_claimed_once_and_again_when_its_sender_died(database, ended, monkeypatch):
    found, job = Deliveries(database), ended()
    first = found.claim()
    assert (first.job_id, first.attempts) == (job, 1)
    assert found.claim() is None
    found.take_over()
    second = found.claim()
    assert (second.id, second.attempts) == (first.id, 2)
    later = time.time() + module.LEASE_S + 1
    monkeypatch.setattr(module, "time", SimpleNamespace(time=lambda: later))
    assert found.claim().attempts == 3


def test_settled_messages_wait_or_rest(database, ended):
    found = Deliveries(database)
    ended()
    one = found.claim()
    found.settle(one, "waiting", {"status": 500}, time.time() + 60.0)
    assert found.claim() is None
    with database.write() as connection:
        connection.execute(update(DeliveryRow).values(due=0.0))
    again = found.claim()
    assert (again.log, again.body) == ([{"status": 500}], one.body)
    found.settle(again, "failed", {"status": 501}, 0.0)
    assert found.claim() is None
    wanted = (LOCAL, "failed"), (None, None), (LOCAL, "waiting"), (Tenant("other"), None)
    assert [len(found.newest(*one, 9)) for one in wanted] == [1, 1, 0, 0]
    assert found.retry([again.id, "msg-unknown"]) == 1
    assert found.claim().attempts == 1


def test_tenants_take_turns(database, ended):
    found = Deliveries(database)
    first = [ended() for _ in range(4)]
    other = ended(LAB)
    claimed = [found.claim().job_id for _ in range(3)]
    assert claimed == [first[0], other, first[1]]
    # Two of one tenant are under way.
    assert found.claim() is None


def test_secrets_of_a_tenant(database, monkeypatch):
    secrets = WebhookSecrets(database)
    old, other = secrets.create(LOCAL), secrets.create(LAB)
    new = secrets.create(LOCAL)
    assert secrets.of(LOCAL) == [new, old]
    assert secrets.of(LAB) == [other]
    later = time.time() + module.OVERLAP_S + 1
    monkeypatch.setattr(module, "time", SimpleNamespace(time=lambda: later))
    assert secrets.of(LOCAL) == [new]

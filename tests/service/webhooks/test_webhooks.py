"""Webhooks of jobs: signed, sent again until they are accepted, also after the service was killed."""

import json
import signal
import subprocess
import sys
import time
from contextlib import closing

import pytest
from sqlalchemy import update

import bentray
from bentray_service.rows.database import open_database
from bentray_service.rows.deliveries import Deliveries, WebhookSecrets
from bentray_service.rows.ids import LOCAL
from bentray_service.rows.tables import DeliveryRow
from bentray_service.settings import ServiceSettings
from bentray_service.webhooks import sender

from ...waiting import wait_until
from ..cli.conftest import bentray as command
from ..conftest import created
from .local_receiver import Receiver

__all__ = ["command"]

NETWORKS = {"webhook_networks": "127.0.0.0/8"}


@pytest.fixture(autouse=True)
def quickly(monkeypatch):
    monkeypatch.setattr(sender, "PAUSES_S", (0.02, 0.02))
    monkeypatch.setattr(sender.Webhooks, "idle_s", 0.02)


@pytest.fixture
def called(start, work, uploaded):
    """Start a service whose tenant has a secret, and a scan; returns both and a function that submits."""
    http = start(**NETWORKS)
    secret = WebhookSecrets(http.app.state.stores.database).create(LOCAL)
    dataset = uploaded(http)

    def submit(webhook, **headers):
        settings = {"method": "sart", "nodes": 16, "iterations": 2}
        request = {"kind": "reconstruction", "dataset": dataset, "settings": settings, "webhook": webhook}
        return http.post("/v1/jobs", json=request, headers=headers)

    return http, secret, submit


def settled(http, job):
    """The webhook of a job that has ended, once its message is no longer waiting."""
    found = []

    def over():
        found[:] = [http.get(f"/v1/jobs/{job}").json()["webhook"]]
        return found[0]["state"] in ("delivered", "failed")

    Receiver.until(over)
    return found[0]


def test_the_message_of_a_job(called, receiver, work, until):
    http, secret, submit = called
    work.hold.clear()
    job = submit(receiver.url).json()
    assert job["webhook"] == {
        "url": receiver.url,
        "state": "pending",
        "message": None,
        "attempts": [],
        "due": None,
    }
    http.patch(f"/v1/jobs/{job['id']}", json={"name": "Mrs Smith"})
    assert receiver.messages == []
    work.hold.set()
    webhook = settled(http, job["id"])
    headers, body = receiver.messages[0]
    content = bentray.verify_webhook(body, headers, secret)
    assert content["type"] == "job.succeeded"
    assert content["data"] == {
        "job": job["id"],
        "kind": "reconstruction",
        "state": "succeeded",
        "address": f"/v1/jobs/{job['id']}",
    }
    assert b"Smith" not in body
    assert headers["content-type"] == "application/json"
    assert headers["webhook-id"] == webhook["message"]
    assert (webhook["state"], webhook["due"]) == ("delivered", None)
    assert [(one["status"], one["error"]) for one in webhook["attempts"]] == [(200, "")]
    assert http.get("/v1/jobs").json()["jobs"][0]["webhook"]["state"] == "pending"
    assert 'bentray_webhooks{state="delivered"} 1.0' in http.get("/metrics").text


@pytest.mark.parametrize("end", ["failed", "cancelled", "cancelled while queued"])
def test_every_end_is_told(called, receiver, work, until, end):
    http, _, submit = called
    if end == "failed":
        work.error = RuntimeError("broken")
    else:
        work.hold.clear()
    jobs = [submit(receiver.url).json()["id"] for _ in range(3 if "queued" in end else 1)]
    if end != "failed":
        if "queued" not in end:
            until(http, jobs[-1], "running")
        http.post(f"/v1/jobs/{jobs[-1]}/cancel")
    settled(http, jobs[-1])
    work.hold.set()
    state = end.partition(" ")[0]
    assert json.loads(receiver.messages[0][1])["type"] == f"job.{state}"


def test_it_is_sent_again_until_it_is_accepted(called, receiver):
    http, secret, submit = called
    receiver.answers = [500, 302]
    webhook = settled(http, submit(receiver.url).json()["id"])
    assert webhook["state"] == "delivered"
    assert [one["status"] for one in webhook["attempts"]] == [500, 302, 200]
    for headers, body in receiver.messages:
        assert bentray.verify_webhook(body, headers, secret)["type"] == "job.succeeded"
    assert len({headers["webhook-id"] for headers, _ in receiver.messages}) == 1
    assert len({body for _, body in receiver.messages}) == 1


def test_it_is_given_up_and_sent_by_hand(called, receiver, command):
    http, _, submit = called
    data = http.app.state.access.settings.data_dir
    receiver.answers = [500] * 3
    failed = settled(http, submit(receiver.url).json()["id"])
    assert (failed["state"], len(failed["attempts"])) == ("failed", 3)
    listed = command("webhooks", "list", "--state", "failed", "--data", data, "--json")
    assert [(one["id"], one["attempts"]) for one in json.loads(listed.stdout)] == [(failed["message"], 3)]
    assert receiver.url not in listed.stdout
    command("webhooks", "retry", failed["message"], "--data", data)
    receiver.wait(4)
    Receiver.until(
        lambda: (
            json.loads(command("webhooks", "list", "--data", data, "--json").stdout)[0]["state"]
            == "delivered"
        )
    )
    command("webhooks", "retry", failed["message"], "--data", data, code=2)


def test_a_receiver_that_is_gone_is_left_alone(called, receiver):
    http, _, submit = called
    receiver.answers = [410]
    webhook = settled(http, submit(receiver.url).json()["id"])
    assert (webhook["state"], len(webhook["attempts"])) == ("failed", 1)


def test_what_is_refused_at_once(called, receiver, start, work, uploaded):
    _, _, submit = called
    for webhook in ("https://10.0.0.1/", "https://user@example.org/", "http://example.org", 7):
        answer = submit(webhook)
        if webhook == "http://example.org":
            # Its address is not known yet, and may be in the permitted network.
            assert answer.status_code == 202
            continue
        assert (answer.status_code, answer.json()["field"].rpartition(".")[2]) == (422, "webhook")
    other = start("other")
    request = {"kind": "reconstruction", "dataset": uploaded(other), "webhook": "https://example.org/"}
    for path in ("/v1/jobs", "/v1/plans"):
        answer = other.post(path, json=request)
        assert answer.status_code == 422
        assert "bentray webhooks create-secret --tenant local" in answer.json()["detail"]
    silent = start("silent", webhooks=False)
    WebhookSecrets(silent.app.state.stores.database).create(LOCAL)
    answer = silent.post("/v1/jobs", json={**request, "dataset": uploaded(silent)})
    assert "BENTRAY_WEBHOOKS" in answer.json()["detail"]


def test_the_webhook_belongs_to_the_idempotency_key(called, receiver):
    _, _, submit = called
    key = {"Idempotency-Key": "one"}
    first = submit(receiver.url, **key).json()["id"]
    assert submit(receiver.url, **key).json()["id"] == first
    assert submit(f"{receiver.url}&other", **key).status_code == 409


def test_a_deleted_job_takes_its_message_along(called, receiver):
    http, _, submit = called
    job = submit(receiver.url).json()["id"]
    settled(http, job)
    assert http.delete(f"/v1/jobs/{job}").status_code == 204
    assert Deliveries(http.app.state.stores.database).newest(None, None, 9) == []


def test_every_job_of_a_batch(called, receiver):
    http, _, _ = called
    dataset = http.get("/v1/datasets").json()["datasets"][0]["id"]
    request = {"datasets": [dataset], "settings": {"method": "sart", "nodes": 16}, "webhook": receiver.url}
    batch = created(http.post("/v1/batches", json=request), 202)
    receiver.wait(1)
    assert json.loads(receiver.messages[0][1])["data"]["job"] == batch["jobs"][0]["id"]


SENDING = """
import sys, time
from pathlib import Path
from bentray_service.rows.database import open_database
from bentray_service.settings import ServiceSettings
from bentray_service.webhooks.sender import Webhooks
settings = ServiceSettings(data_dir=Path(sys.argv[1]), webhook_networks="127.0.0.0/8")
Webhooks(open_database(settings.database), settings).start()
time.sleep(600)
"""


def test_killed_while_it_sends(called, receiver, monkeypatch):
    """Killed after the message arrived and before its answer: it is sent again, under the same id."""
    http, _, submit = called
    settings = http.app.state.access.settings
    http.app.state.background.webhooks.stop()
    job = submit(receiver.url).json()["id"]
    Receiver.until(lambda: http.get(f"/v1/jobs/{job}").json()["webhook"]["state"] == "waiting")
    receiver.hold.clear()
    process = subprocess.Popen([sys.executable, "-c", SENDING, str(settings.data_dir)])
    try:
        receiver.wait(1)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    receiver.hold.set()
    with closing(open_database(settings.database)) as database:
        again = sender.Webhooks(database, settings)
        again.start()
        webhook = settled(http, job)
        again.stop()
    assert webhook["state"] == "delivered"
    assert [headers["webhook-id"] for headers, _ in receiver.messages] == [webhook["message"]] * 2


def test_a_new_secret_and_the_one_before_both_sign(called, receiver, command):
    http, old, submit = called
    data = http.app.state.access.settings.data_dir
    new = command("webhooks", "create-secret", "--data", data).stdout.strip()
    assert new.startswith("whsec_")
    settled(http, submit(receiver.url).json()["id"])
    headers, body = receiver.messages[0]
    for secret in (old, new):
        bentray.verify_webhook(body, headers, secret)


def test_slow_receivers_of_one_tenant_delay_no_other(called, receiver):
    http, _, submit = called
    database = http.app.state.stores.database
    slow = Receiver()
    slow.hold.clear()
    jobs = [submit(slow.url).json()["id"] for _ in range(4)]
    slow.wait(2)
    time.sleep(0.2)
    assert len(slow.messages) == 2
    waiting = Deliveries(database).newest
    left = wait_until(lambda: [row for row in waiting(None, "waiting", 9) if not row.attempts])
    with database.write() as connection:
        # One of the waiting messages is of another tenant.
        other = update(DeliveryRow).where(DeliveryRow.id == left[0].id)
        connection.execute(other.values(tenant="lab", url=receiver.url))
    WebhookSecrets(database).create("lab")
    receiver.wait(1)
    slow.close()
    assert len(jobs) == 4


def test_wrong_networks_are_refused_at_the_start(tmp_path):
    settings = ServiceSettings(data_dir=tmp_path, webhook_networks="10.0.0.0/33")
    refused = pytest.raises(bentray.InvalidInput, match="BENTRAY_WEBHOOK_NETWORKS")
    with closing(open_database(settings.database)) as database, refused:
        sender.Webhooks(database, settings)

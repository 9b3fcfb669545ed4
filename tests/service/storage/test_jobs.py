"""Jobs in the database: their order, their states, their events."""

import threading
import time

import pytest

from bentray_service.refusals import Finished, KeyReused, QueueFull, UnknownId
from bentray_service.storage.datasets import Datasets
from bentray_service.storage.ids import new_id, volume_of
from bentray_service.storage.jobs import LEASE_S, Jobs
from bentray_service.storage.volumes import Volumes

PROBLEM = {"type": "/problems/x", "title": "t", "status": 500, "detail": "why"}
SUMMARY = {
    "title": "",
    "source": "",
    "license": "",
    "dimension": 2,
    "elements": 3,
    "ntx": 3,
    "nrx": 3,
    "slices": 1,
    "has_traces": False,
    "has_travel_times": True,
    "has_truth": False,
    "water_speed_mps": 1500.0,
}


@pytest.fixture
def jobs(database):
    return Jobs(database)


@pytest.fixture
def dataset(database):
    return Datasets(database).add(new_id("dataset"), size=1, sha256="0" * 64, summary=SUMMARY)["id"]


def volume(job_id):
    return {
        "id": volume_of(job_id),
        "bytes": 1,
        "axes": "x,y",
        "shape": [2, 2],
        "spacing_m": [1.0, 1.0],
        "origin_m": [0.0, 0.0],
        "speed_range_mps": [1.0, 2.0],
        "water_speed_mps": 1500.0,
        "provenance": {},
    }


def test_claimed_in_order_listed_newest_first(jobs, dataset):
    made = [jobs.add("reconstruction", {}, dataset)["id"] for _ in range(3)]
    assert [row["id"] for row in jobs.newest(10)] == made[::-1]
    assert [row["id"] for row in jobs.newest(2)] == made[:0:-1]
    assert [jobs.claim()["id"] for _ in range(3)] == made
    assert jobs.claim() is None


def test_no_job_is_claimed_twice(jobs, dataset):
    made = {jobs.add("reconstruction", {}, dataset)["id"] for _ in range(12)}
    claimed = []

    def take():
        while (job := jobs.claim()) is not None:
            claimed.append(job["id"])

    threads = [threading.Thread(target=take) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(claimed) == 12
    assert set(claimed) == made


def test_success_comes_with_its_volume(database, jobs, dataset):
    job = jobs.add("reconstruction", {"nodes": 16}, dataset)
    jobs.claim()
    jobs.progress(job["id"], 4, 4, [{"slice": 0, "sweep": 1, "residual_rms_s": None, "emitters": 4}])
    assert jobs.succeed(job["id"], volume(job["id"]))
    row = jobs.get(job["id"])
    assert (row["state"], row["done"], row["history"][0]["emitters"]) == ("succeeded", 4, 4)
    assert row["finished"] >= row["started"]
    assert Volumes(database).get(volume_of(job["id"]))["dataset_id"] == dataset
    assert [event["state"] for event in jobs.events(job["id"])] == ["queued", "running", "succeeded"]


def test_a_cancelled_job_cannot_succeed(database, jobs, dataset):
    job = jobs.add("reconstruction", {}, dataset)
    jobs.claim()
    assert jobs.request_cancel(job["id"])["state"] == "cancelling"
    assert not jobs.succeed(job["id"], volume(job["id"]))
    with pytest.raises(UnknownId):
        Volumes(database).get(volume_of(job["id"]))
    jobs.cancelled(job["id"])
    assert jobs.state(job["id"]) == "cancelled"


def test_a_queued_job_is_cancelled_at_once(jobs, dataset):
    job = jobs.add("reconstruction", {}, dataset)
    assert jobs.request_cancel(job["id"])["state"] == "cancelled"
    assert jobs.claim() is None
    with pytest.raises(Finished, match="cancelled"):
        jobs.request_cancel(job["id"])


def test_failure_keeps_the_reason(jobs, dataset):
    job = jobs.add("reconstruction", {}, dataset)
    jobs.claim()
    jobs.fail(job["id"], PROBLEM)
    assert jobs.get(job["id"])["error"] == PROBLEM
    assert jobs.events(job["id"])[-1]["note"] == "why"


def test_release_is_no_attempt(jobs, dataset):
    job = jobs.add("reconstruction", {}, dataset)
    jobs.claim()
    jobs.progress(job["id"], 3, 9, [])
    jobs.release(job["id"], "a reason")
    row = jobs.get(job["id"])
    assert (row["state"], row["attempts"], row["started"]) == ("queued", 0, None)
    assert jobs.claim()["done"] == 0


def test_a_job_that_kills_the_service_is_given_up(database, jobs, dataset):
    job = jobs.add("reconstruction", {}, dataset)
    ends = []
    for _ in range(3):
        Jobs(database).claim()
        jobs.recover(PROBLEM, alone=True)
        ends.append(jobs.state(job["id"]))
    assert ends == ["queued", "queued", "failed"]


def test_a_job_that_gets_further_is_taken_up_again_and_again(database, jobs, dataset):
    job = jobs.add("reconstruction", {}, dataset)
    for _ in range(8):
        dying = Jobs(database)
        assert dying.claim()["id"] == job["id"]
        dying.got_further(job["id"])
        assert jobs.recover(PROBLEM, alone=True) == 1
    assert jobs.get(job["id"])["attempts"] == 1
    assert [event["state"] for event in jobs.events(job["id"])] == ["queued", *8 * ["running", "queued"]]


def test_a_service_beside_others_takes_only_what_is_given_up(database, jobs, dataset, monkeypatch):
    job = jobs.add("reconstruction", {}, dataset)
    other = Jobs(database)
    other.claim()
    assert jobs.recover(PROBLEM, alone=False) == 0
    later = time.time() + LEASE_S + 1.0
    monkeypatch.setattr("bentray_service.storage.jobs.time.time", lambda: later)
    other.renew()
    assert jobs.recover(PROBLEM, alone=False) == 0
    monkeypatch.setattr("bentray_service.storage.jobs.time.time", lambda: later + LEASE_S + 1.0)
    assert other.recover(PROBLEM, alone=False) == 0, "its own job is at work"
    assert jobs.recover(PROBLEM, alone=False) == 1
    assert jobs.claim()["id"] == job["id"]
    # The first one wakes up and has lost its job.
    assert other.told(job["id"]) is None
    other.progress(job["id"], 7, 9, [])
    other.fail(job["id"], PROBLEM)
    other.release(job["id"], "late")
    assert not other.succeed(job["id"], volume(job["id"]))
    row = jobs.get(job["id"])
    assert (row["state"], row["done"], jobs.told(job["id"])) == ("running", 0, "running")
    assert jobs.succeed(job["id"], volume(job["id"]))


def test_tenants_take_turns(jobs, dataset):
    for tenant, count in (("a", 5), ("b", 2), ("c", 1)):
        for _ in range(count):
            jobs.add("reconstruction", {}, dataset, tenant=tenant)
    order = []
    for _ in range(8):
        job = jobs.claim()
        order.append(job["tenant"])
        jobs.fail(job["id"], PROBLEM)
        # A clock too coarse to tell two starts apart would leave the order to the numbers.
        time.sleep(0.002)
    assert order == ["a", "b", "c", "a", "b", "a", "a", "a"]
    for _ in range(3):
        jobs.add("reconstruction", {}, dataset, tenant="a")
    jobs.add("reconstruction", {}, dataset, tenant="b")
    assert [jobs.claim()["tenant"] for _ in range(3)] == ["b", "a", "a"]


def test_a_full_queue_refuses_of_this_tenant_alone(jobs, dataset):
    for _ in range(2):
        jobs.add("reconstruction", {}, dataset, tenant="a", most_queued=2)
    with pytest.raises(QueueFull, match="2 that wait"):
        jobs.add("reconstruction", {}, dataset, tenant="a", most_queued=2)
    jobs.add("reconstruction", {}, dataset, tenant="b", most_queued=2)
    jobs.claim()
    jobs.add("reconstruction", {}, dataset, tenant="a", most_queued=2)


@pytest.mark.parametrize("job_id", ["job-" + "0" * 20, "../../x", ""])
def test_unknown_ids(jobs, job_id):
    for ask in (jobs.get, jobs.request_cancel):
        with pytest.raises(UnknownId):
            ask(job_id)


def test_a_job_on_a_volume_ends_without_one(jobs, database):
    job = jobs.add("refraction", {"frames": 3}, volume_id="vol-" + "0" * 20)
    assert (job["dataset_id"], job["volume_id"]) == (None, "vol-" + "0" * 20)
    jobs.claim()
    assert jobs.succeed(job["id"], None)
    assert jobs.state(job["id"]) == "succeeded"
    with pytest.raises(UnknownId):
        Volumes(database).get(volume_of(job["id"]))


def test_a_key_names_one_job_of_its_tenant(database, jobs, dataset):
    made = []

    def add():
        made.append(jobs.add("reconstruction", {"nodes": 16}, dataset, key="k")["id"])

    threads = [threading.Thread(target=add) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(made), len(set(made))) == (6, 1)
    with pytest.raises(KeyReused):
        jobs.add("reconstruction", {"nodes": 17}, dataset, key="k")
    assert jobs.add("reconstruction", {"nodes": 17}, dataset, key="k", tenant="b")["id"] not in made
    assert [len(jobs.newest(9, state=state)) for state in ("queued", "running")] == [2, 0]
    assert jobs.load()[0] == {"queued": 2}

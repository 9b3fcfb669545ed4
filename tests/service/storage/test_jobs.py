"""Jobs in the database: their order, their states, their events."""

import threading

import pytest

from bentray_service.refusals import Finished, UnknownId
from bentray_service.storage.database import open_database
from bentray_service.storage.datasets import Datasets
from bentray_service.storage.ids import new_id, volume_of
from bentray_service.storage.jobs import Jobs
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
def database(tmp_path):
    opened = open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")
    yield opened
    opened.close()


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
    jobs.release(job["id"])
    row = jobs.get(job["id"])
    assert (row["state"], row["attempts"], row["started"]) == ("queued", 0, None)
    assert jobs.claim()["done"] == 0


def test_a_job_that_kills_the_service_is_given_up(jobs, dataset):
    job = jobs.add("reconstruction", {}, dataset)
    ends = []
    for _ in range(3):
        jobs.claim()
        jobs.recover(PROBLEM)
        ends.append(jobs.state(job["id"]))
    assert ends == ["queued", "queued", "failed"]


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

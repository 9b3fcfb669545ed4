"""The whole service with its files in a bucket: outages, an emptied data folder, a second service."""

import shutil

import pytest

from bentray_service.files.bucket import Bucket
from bentray_service.jobs import runner

from ...waiting import wait_until
from ..conftest import HDF5
from ..tus_records import PIECE, TUS


@pytest.fixture
def service(start, tmp_path, bucket_url, monkeypatch):
    """Starts services with data folders of their own, one database and one bucket."""
    monkeypatch.setattr(runner, "STORE_SECONDS", 0.05)
    shared = {"storage_url": bucket_url, "database_url": f"sqlite:///{tmp_path / 'shared.sqlite'}"}
    return lambda folder: start(folder, **shared)


def told(answer):
    """Text of a refusal."""
    assert answer.headers["content-type"] == "application/problem+json"
    return answer.status_code, answer.json()["type"], answer.headers["retry-after"]


AWAY = (503, "/problems/storage-away", "10")


@pytest.fixture
def publishing(work, running, s3_server):
    """Let a job end whose result waits for the bucket, which is away; returns its id."""

    def go(http):
        job = running(http)["id"]
        wait_until(lambda: work.calls)
        s3_server.away.set()
        s3_server.asked.clear()
        work.hold.set()
        wait_until(lambda: any("/volumes/" in path for _, path in list(s3_server.asked)))
        return job

    return go


def test_a_result_is_served_from_the_bucket_wherever_it_was_made(
    service, tmp_path, scan, work, uploaded, submitted, until, s3_server, bucket_url
):
    first = service("one")
    dataset = uploaded(first)
    job = until(first, submitted(first, dataset)["id"])
    path = job["links"]["volume"]
    whole = first.get(f"{path}/data")
    used = first.get("/v1/access").json()["bytes_stored"]
    folder = tmp_path / "one" / "tenants" / "local"
    for kind in ("datasets", "volumes"):
        shutil.rmtree(folder / kind)
        (folder / kind).mkdir()
    assert first.get("/v1/access").json()["bytes_stored"] == used

    # With nothing here and the bucket away it says so, and everything is there again when that is back.
    s3_server.away.set()
    for answer in (
        first.get(f"{path}/data"),
        first.get(f"{path}/slice.png"),
        first.post("/v1/datasets", content=scan().read_bytes(), headers=HDF5),
        first.delete(f"/v1/datasets/{dataset}"),
    ):
        assert told(answer) == AWAY
    # A job is planned from what the database tells, and waits for the files.
    waiting = first.post("/v1/jobs", json={"kind": "reconstruction", "dataset": dataset})
    assert waiting.status_code == 202
    ready = first.get("/health/ready")
    assert (ready.status_code, ready.json()["field"]) == (503, "storage")
    assert "bentray_storage_up 0.0" in first.get("/metrics").text
    s3_server.away.clear()
    assert first.get("/health/ready").status_code == 200
    assert until(first, waiting.json()["id"])["state"] == "succeeded"
    assert len(first.get("/v1/datasets").json()["datasets"]) == 1

    second = service("two")
    for http in (first, second):
        again = http.get(f"{path}/data")
        assert (again.content, again.headers["etag"]) == (whole.content, whole.headers["etag"])
        assert http.get(f"{path}/data", params={"format": "npy"}).status_code == 200
        assert http.get(f"{path}/slice.png").content.startswith(b"\x89PNG")
    assert until(second, submitted(second, dataset)["id"])["state"] == "succeeded"
    assert second.delete(f"/v1/datasets/{dataset}").status_code == 204
    assert first.get(path).status_code == 404
    assert not list(Bucket(bucket_url).listed("tenants/"))


def test_a_result_waits_for_the_bucket_and_is_not_lost(service, work, publishing, until, s3_server):
    http = service("one")
    job = publishing(http)
    assert http.get(f"/v1/jobs/{job}").json()["state"] == "running"
    s3_server.away.clear()
    done = until(http, job)
    assert done["state"] == "succeeded"
    assert len(work.calls) == 1
    assert http.get(f"{done['links']['volume']}/data").status_code == 200


def test_a_job_can_be_cancelled_while_its_result_waits(service, publishing, until):
    http = service("one")
    job = publishing(http)
    assert http.post(f"/v1/jobs/{job}/cancel").status_code == 202
    assert until(http, job)["state"] == "cancelled"
    assert http.get("/v1/volumes").json()["volumes"] == []


def test_publication_resumes_at_the_next_start(service, publishing, until, s3_server):
    http = service("one")
    job = publishing(http)
    http.__exit__(None, None, None)
    s3_server.away.clear()
    assert until(service("one"), job)["state"] == "succeeded"


def test_an_upload_in_pieces_waits_too(service, scan, s3_server, monkeypatch):
    monkeypatch.setattr("bentray_service.ingest.upload_ingest.PATIENCE_SECONDS", 0.05)
    http, content = service("one"), scan().read_bytes()
    begun = http.post("/v1/uploads", headers={**TUS, "Upload-Length": str(len(content))})
    location = begun.headers["location"]
    s3_server.away.set()
    s3_server.asked.clear()
    piece = {**PIECE, "Upload-Offset": "0"}
    assert http.patch(location, content=content, headers=piece).status_code == 204
    wait_until(lambda: any("/datasets/" in path for _, path in list(s3_server.asked)))
    assert http.get(location).json()["state"] == "reading"
    s3_server.away.clear()
    wait_until(lambda: http.get(location).json()["state"] != "reading")
    assert http.get(location).json()["state"] == "done"


def test_a_folder_from_before_there_was_a_bucket_is_put_into_it(start, uploaded, bucket_url):
    http = start("data")
    dataset = uploaded(http)
    http.__exit__(None, None, None)
    http = start("data", storage_url=bucket_url)
    wait_until(lambda: [item["path"] for item in Bucket(bucket_url).listed("tenants/")])
    assert [item["path"] for item in Bucket(bucket_url).listed("tenants/")] == [
        f"tenants/local/datasets/{dataset}.h5"
    ]
    assert http.get("/health/ready").status_code == 200

"""/v1/direct-uploads: straight to the bucket by presigned addresses, with the checks of every upload."""

import hashlib

import httpx
import numpy as np
import pytest

from bentray_service.client import Client
from bentray_service.errors import StorageUnavailable
from bentray_service.files import direct_uploads
from bentray_service.files.bucket import Bucket

from ..conftest import created
from ..tus_records import PIECE, TUS, settled

PLACE = "/v1/direct-uploads"


@pytest.fixture
def service(start, bucket_url):
    return lambda **settings: start(storage_url=bucket_url, **settings)


@pytest.fixture
def objects(bucket_url):
    """Keys of the objects beside the stored items."""
    return lambda: [one["path"] for one in Bucket(bucket_url).listed(direct_uploads.FOLDER)]


def begun(http, data, **more):
    return created(http.post(PLACE, json={"length": len(data), **more}))


def send(http, upload, data, numbers=None):
    """Send parts as any program does: without the key, and knowing nothing of the service."""
    numbers = numbers or list(range(1, upload["parts"] + 1))
    record = created(http.post(upload["links"]["parts"], json={"numbers": numbers}), 200)
    for part in record["parts"]:
        begin = (part["number"] - 1) * upload["part_bytes"]
        sent = httpx.put(part["url"], content=data[begin : begin + part["bytes"]])
        assert sent.status_code == 200, sent.text
    return record


def ended(http, upload):
    """The record of an upload that is completed and read."""
    assert http.post(upload["links"]["complete"]).status_code == 202
    return settled(http, upload["links"]["self"])


def test_parts_are_assembled_and_read_as_any_upload(service, scan, objects):
    http = service()
    path = scan(lambda file: file.create_dataset("ignored", data=np.random.default_rng(1).random(2_400_000)))
    data = path.read_bytes()
    assert len(data) > direct_uploads.PART_BYTES
    upload = begun(http, data)
    assert (upload["state"], upload["parts"], upload["part_bytes"]) == ("receiving", 2, 16 * 2**20)
    used = http.get("/v1/access").json()
    assert used["bytes_reserved"] == len(data)
    send(http, upload, data, [2])
    early = http.post(upload["links"]["complete"])
    assert (early.status_code, early.json()["field"]) == (409, "parts")
    assert send(http, upload, data)["received"] == [2]
    assert http.post(upload["links"]["complete"]).status_code == 202
    done = ended(http, upload)
    dataset = http.get(f"/v1/datasets/{done['result']}").json()
    assert (dataset["title"], dataset["bytes"]) == ("Sixteen elements", len(data))
    assert dataset["sha256"] == hashlib.sha256(data).hexdigest()
    assert objects() == []
    assert http.get("/v1/access").json()["bytes_reserved"] == 0


def test_addresses_are_signed_for_the_public_endpoint(service, scan, s3_server, monkeypatch, objects):
    """The service reaches the server by one name, clients by another; the host is in the signature."""
    http = service(storage_public_endpoint=f"http://localhost:{s3_server.port}")
    data = scan().read_bytes()
    upload = begun(http, data)
    (part,) = http.post(upload["links"]["parts"], json={"numbers": [1]}).json()["parts"]
    url = httpx.URL(part["url"])
    assert (url.host, url.port) == ("localhost", s3_server.port)
    assert "host" in url.params["X-Amz-SignedHeaders"].split(";")
    # As a bucket checks it: the signature of this host, and of no other.
    signed = Bucket("s3://any", f"http://localhost:{s3_server.port}"), Bucket("s3://any")
    assert len({httpx.URL(one.put_url("k", 60)).params["X-Amz-Signature"] for one in signed}) == 2
    send(http, upload, data)
    assert ended(http, upload)["state"] == "done"
    assert objects() == []


def test_through_the_client(serve, scan, bucket_url, objects):
    address = serve(storage_url=bucket_url)
    with Client(address) as client:
        seen = []
        dataset = client.upload(scan(), lambda sent, total: seen.append((sent, total)), direct=True)
        assert dataset.title == "Sixteen elements"
        size = scan().stat().st_size
        assert seen[-1] == (size, size)
        assert client.datasets()[0].id == dataset.id
    assert objects() == []


def test_hostile_content_is_refused_and_forgotten(service, objects):
    http = service()
    upload = begun(http, b"certainly not HDF5")
    send(http, upload, b"certainly not HDF5")
    result = ended(http, upload)
    assert (result["state"], result["problem"]["status"]) == ("refused", 422)
    assert objects() == []
    assert http.get("/v1/access").json()["bytes_reserved"] == 0
    assert http.post(upload["links"]["parts"], json={"numbers": [1]}).json()["field"] == "state"


def test_what_is_larger_than_announced_is_not_taken(service, scan):
    http = service()
    upload = begun(http, b"x" * 100)
    url = http.post(upload["links"]["parts"], json={"numbers": [1]}).json()["parts"][0]["url"]
    assert httpx.put(url, content=b"x" * 101).status_code == 200
    answer = http.post(upload["links"]["complete"])
    assert (answer.status_code, answer.json()["found"]) == (409, "1 parts, 101 bytes")


def test_the_quota_and_the_largest_size_hold(service):
    http = service(max_tenant_bytes=1000, max_upload_bytes=900)
    assert http.post(PLACE, json={"length": 901}).status_code == 413
    begun(http, b"x" * 800)
    assert http.post(PLACE, json={"length": 300}).status_code == 507


def test_deletion_and_expiry_empty_the_bucket(service, objects):
    http = service()
    upload, other = begun(http, b"x" * 10), begun(http, b"x" * 10)
    for one in (upload, other):
        send(http, one, b"x" * 10)
    assert len(objects()) == 2
    assert http.delete(upload["links"]["self"], headers=TUS).status_code == 204
    state = http.app.state
    state.background.housekeeper.forget(state.background.ingest.uploads.get("local", other["id"]))
    assert objects() == []
    assert http.get(other["links"]["self"]).status_code == 404


def test_data_without_an_upload_is_removed_after_a_day(service, bucket_url, objects, monkeypatch):
    service()
    bucket = Bucket(bucket_url)
    bucket.put_metadata("direct/up-gone/00001", {})
    bucket.put_metadata("direct/up-known/00001", {})
    direct = direct_uploads.DirectUploads(bucket)
    direct.tidy(lambda: {"up-known"})
    assert len(objects()) == 2
    monkeypatch.setattr(direct_uploads, "FORGOTTEN_S", -60.0)
    direct.tidy(lambda: {"up-known"})
    assert objects() == ["direct/up-known/00001"]


def test_a_bucket_that_is_away_is_waited_for(service, scan, s3_server, monkeypatch):
    monkeypatch.setattr("bentray_service.ingest.upload_ingest.PATIENCE_SECONDS", 0.1)
    http = service()
    data = scan().read_bytes()
    upload = begun(http, data)
    send(http, upload, data)
    direct = http.app.state.stores.files.store.direct_uploads
    fetch, calls = direct.fetch, []

    def away_once(row, path):
        calls.append(row.id)
        if len(calls) == 1:
            raise StorageUnavailable("away")
        fetch(row, path)

    monkeypatch.setattr(direct, "fetch", away_once)
    assert ended(http, upload)["state"] == "done"
    assert len(calls) == 2


def test_the_two_ways_are_not_mixed(service, start, scan):
    http = service()
    upload = begun(http, b"x" * 10)
    answer = http.patch(upload["links"]["self"], content=b"x", headers={**PIECE, "Upload-Offset": "0"})
    assert (answer.status_code, answer.json()["field"]) == (409, "upload")
    tus = http.post("/v1/uploads", headers={**TUS, "Upload-Length": "9"}).json()["id"]
    assert http.post(f"{PLACE}/{tus}/complete").json()["field"] == "upload"
    local = start("local")
    answer = local.post(PLACE, json={"length": 9})
    assert (answer.status_code, answer.json()["type"]) == (409, "/problems/no-bucket")

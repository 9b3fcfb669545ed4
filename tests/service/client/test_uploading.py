"""Uploads in pieces: over broken connections, over a restart of the client, and by another's client."""

import asyncio
import hashlib
import time

import httpx
import numpy as np
import pytest
from tusclient.client import TusClient
from tusclient.exceptions import TusCommunicationError

from bentray_kernels.errors import InvalidInput
from bentray_service.client import AsyncClient, Client, ClientError, uploading

from .cutting_proxy import cutting

MIB = 2**20


@pytest.fixture
def large(scan):
    """A scan of 9 MB that does not pack."""

    def pad(file):
        file["padding"] = np.random.default_rng(0).integers(0, 256, 9 * MIB, dtype=np.uint8)

    return scan(pad)


@pytest.fixture(autouse=True)
def without_delay(monkeypatch):
    monkeypatch.setattr(uploading, "FIRST_PAUSE_S", 0.01)
    monkeypatch.setattr(uploading, "LONGEST_PAUSE_S", 0.05)


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("cuts", [[], [3 * MIB], [MIB, 3 * MIB, 3 * MIB + 1000]])
def test_a_large_file_arrives_whole_over_any_line(serve, large, cuts):
    sent, planned = [], len(cuts)
    with cutting(serve(), cuts) as proxy, Client(proxy.url) as client:
        dataset = client.upload(large, lambda done, total: sent.append((done, total)))
    assert (dataset.bytes, dataset.sha256) == (large.stat().st_size, digest(large))
    assert sent[-1] == (dataset.bytes, dataset.bytes)
    assert cuts == []
    assert proxy.made > planned


def test_so_it_does_asynchronously(serve, large):
    async def call(url):
        async with AsyncClient(url) as client:
            return await client.upload(large)

    cuts = [MIB, 3 * MIB]
    with cutting(serve(), cuts) as proxy:
        assert asyncio.run(call(proxy.url)).sha256 == digest(large)
    assert cuts == []


def test_upload_resumes_in_a_later_session(serve, large, monkeypatch):
    url = serve()
    with cutting(url, [4 * MIB]) as proxy, Client(proxy.url) as client, monkeypatch.context() as patch:
        patch.setattr(uploading, "TRIES", 1)
        with pytest.raises(ClientError) as broken:
            client.upload(large)
        assert broken.value.upload.startswith("up-")
    # A session that begins before the service notices the end of the last one sends all again.
    upload = f"{url}/v1/uploads/{broken.value.upload}"
    while httpx.head(upload, headers=uploading.TUS).headers["Upload-Offset"] == "0":
        time.sleep(0.02)
    monkeypatch.setattr(uploading, "LONGEST_PAUSE_S", 15.0)
    begun = []
    with Client(url) as client:
        dataset = client.upload(large, lambda done, total: begun.append(done), resume=broken.value.upload)
    assert dataset.sha256 == digest(large)
    # What had come was not sent again.
    assert begun[0] > 3 * MIB


def test_another_file_is_no_continuation(serve, large, scan, monkeypatch):
    monkeypatch.setattr(uploading, "TRIES", 1)
    with cutting(serve(), [4 * MIB]) as proxy, Client(proxy.url) as client:
        with pytest.raises(ClientError) as broken:
            client.upload(large)
        with pytest.raises(ClientError, match=r"bytes, but the upload at .* has"):
            client.upload(scan(name="small.h5"), resume=broken.value.upload)


def test_dead_connection_ends_the_upload(serve, large):
    with cutting(serve(), [2000] * 1000) as proxy, Client(proxy.url, patience_s=1.0) as client:
        with pytest.raises(ClientError, match="no answer"):
            client.upload(large)
        assert proxy.made < 100


def test_rejection_while_reading_is_reported(serve, scan):
    def spoil(file):
        file["geometry/element_position_m"][5] = np.nan
        file["padding"] = np.zeros(200_000, dtype=np.uint8)

    with Client(serve()) as client, pytest.raises(ClientError) as refused:
        client.upload(scan(spoil))
    assert (refused.value.status, refused.value.field) == (422, "geometry/element_position_m")


def test_oversize_is_reported_before_sending(serve, large):
    with Client(serve(max_upload_bytes=MIB)) as client, pytest.raises(ClientError) as refused:
        client.upload(large, lambda done, total: pytest.fail("something was sent"))
    assert (refused.value.status, refused.value.field) == (413, "Upload-Length")


def test_volumes_too(serve, tmp_path):
    np.save(tmp_path / "small.npy", np.ones((4, 4, 4), np.float32))
    np.save(tmp_path / "large.npy", np.ones((40, 40, 40), np.float32))
    with Client(serve()) as client:
        for name in ("small.npy", "large.npy"):
            volume = client.upload(tmp_path / name, kind="volume", title="A head", spacing_m="0.002")
            assert (volume.title, volume.spacing_m) == ("A head", [0.002] * 3)
            result = client.result(volume.id)
            np.testing.assert_array_equal(result.values["value"], np.load(tmp_path / name))
            np.testing.assert_allclose(result.coordinates["y"][:3], [0.0, 0.002, 0.004])
            assert (result.units, result.attributes["title"]) == ({"value": ""}, "A head")
        with pytest.raises(InvalidInput, match="kind"):
            client.upload(tmp_path / "small.npy", kind="picture")


def test_tuspy_interoperates_also_over_a_broken_line(serve, large):
    url = serve()
    cuts = [3 * MIB]
    with cutting(url, cuts) as proxy:
        uploader = TusClient(f"{proxy.url}/v1/uploads").uploader(
            str(large), chunk_size=2 * MIB, metadata={"filename": "scan.h5"}, upload_checksum=True
        )
        with pytest.raises(TusCommunicationError):
            uploader.upload()
    assert cuts == []
    location = url + uploader.url.removeprefix(proxy.url)
    # Every piece came whole or not at all, since it has a checksum.
    again = TusClient(f"{url}/v1/uploads").uploader(
        str(large), chunk_size=2 * MIB, url=location, upload_checksum=True, retries=100, retry_delay=0.1
    )
    assert again.offset == uploader.offset == 2 * MIB
    again.upload()
    assert again.offset == large.stat().st_size
    with Client(url) as client:
        assert client.upload(large, resume=location.rpartition("/")[2]).sha256 == digest(large)


def test_an_empty_file_is_rejected(serve, tmp_path):
    (tmp_path / "empty.h5").touch()
    with Client(serve()) as client, pytest.raises(ClientError) as refused:
        client.upload(tmp_path / "empty.h5")
    assert refused.value.status == 422

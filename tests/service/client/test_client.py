"""The client against a real socket: every call, every refusal; and that for event loops."""

import asyncio

import numpy as np
import pytest

from bentray_kernels.acquisition import PICKERS
from bentray_kernels.errors import InvalidInput
from bentray_service.client import AsyncClient, Client, ClientError
from bentray_service.rows.keys import ApiKey
from bentray_workers.files.dataset import read_dataset


@pytest.fixture
def dataset(client, scan):
    return client.upload(scan()).id


def test_whole_path(client, scan, tmp_path):
    sent = []
    dataset = client.upload(str(scan()), lambda done, total: sent.append((done, total)))
    assert sent[-1] == (dataset.bytes, dataset.bytes)
    job = client.submit(dataset.id, {"nodes": 16, "iterations": 2})
    seen = []
    done = client.wait(job.id, seen.append)
    assert seen[-1] == done
    assert client.volume(done.volume).shape == [16, 16]
    assert client.slice_png(done.volume, quantity="coverage").startswith(b"\x89PNG")
    assert np.load(client.download(done.volume, "npy", str(tmp_path / "speed.npy"))).shape == (16, 16)
    one, other = (client.download(done.volume, name, tmp_path / f"r.{name}") for name in ("hdf5", "h5"))
    assert one.read_bytes() == other.read_bytes() > b""
    assert not list(tmp_path.glob("*.partial"))


def test_a_scan_is_fetched(client, scan, tmp_path):
    dataset, told = client.upload(scan()).id, []
    path = client.download_dataset(dataset, tmp_path / "back.h5", lambda *step: told.append(step))
    size = path.stat().st_size
    assert told[-1] == (size, size)
    np.testing.assert_array_equal(read_dataset(path).delta_tof_s, read_dataset(scan()).delta_tof_s)


def test_refusal_carries_the_fields(client, dataset):
    with pytest.raises(ClientError) as caught:
        client.submit(dataset, {"picking": {"picker": "magic"}})
    error = caught.value
    assert (error.status, error.field, error.found) == (422, "settings.picking.picker", "'magic'")
    assert all(picker in str(error) for picker in PICKERS)


def test_failed_job_raises_its_problem(client, dataset, work):
    work.error = InvalidInput("traveltime", "every pair missing", "at least one pair")
    with pytest.raises(ClientError, match="every pair missing") as caught:
        client.wait(client.submit(dataset, {"nodes": 16}).id)
    assert caught.value.field == "traveltime"


def test_cancelled_job_raises(client, dataset, work):
    work.hold.clear()
    job = client.submit(dataset, {"nodes": 16})
    client.cancel(job.id)
    with pytest.raises(ClientError, match="was cancelled"):
        client.wait(job.id)


def test_a_broken_download_leaves_nothing(client, tmp_path):
    (tmp_path / "kept.h5").write_bytes(b"old")
    with pytest.raises(ClientError):
        client.download("vol-" + "0" * 20, "hdf5", tmp_path / "kept.h5")
    assert [path.name for path in tmp_path.glob("kept*")] == ["kept.h5"]
    assert (tmp_path / "kept.h5").read_bytes() == b"old"


def test_missing_file_and_folder(client, tmp_path):
    with pytest.raises(ClientError, match=r"none\.h5 cannot be read"):
        client.upload(tmp_path / "none.h5")


def test_unreachable_service_is_reported():
    with (
        Client("http://127.0.0.1:9") as client,
        pytest.raises(
            ClientError, match=r"no answer from http://127.0.0.1:9.*; bentray serve starts a service"
        ),
    ):
        client.job("x")


@pytest.mark.parametrize("url", ["", "lab:8000", "http://", "ftp://lab", "http://lab:port"])
def test_rejects_invalid_urls(url):
    with pytest.raises(InvalidInput, match="url: found"):
        Client(url)


def test_a_key_is_given_or_in_the_environment(serve, tmp_path, monkeypatch):
    key = ApiKey.new().shown()
    (tmp_path / "key").write_text(key)
    address = serve(first_key_file=tmp_path / "key")
    with Client(address) as nobody, pytest.raises(ClientError, match="Authentication required") as refusal:
        nobody.job("job-" + "0" * 20)
    assert refusal.value.status == 401
    monkeypatch.setenv("BENTRAY_KEY", key)
    with Client(address) as client, pytest.raises(ClientError, match="Unknown id") as unknown:
        client.job("job-" + "0" * 20)
    assert unknown.value.status == 404
    assert key not in str(unknown.value)
    monkeypatch.delenv("BENTRAY_KEY")
    with Client(address, key=key) as client, pytest.raises(ClientError, match="Unknown id"):
        client.job("job-" + "0" * 20)


def test_a_simulation_is_asked_for_with_its_settings(client):
    job = client.simulate({"nodes": 16, "elements": 16, "snr": 20.0})
    assert (job.kind, job.settings["elements"], job.settings["snr"]) == ("simulation", 16, 20.0)
    assert job.plan.result_bytes == 2 * 8 * 16 * 16
    assert client.simulate().settings["nodes"] == 128
    with pytest.raises(ClientError, match="null, unless waveform is true"):
        client.simulate({"side_m": 0.1})


def test_a_reconstruction_has_places_units_and_provenance(client, dataset):
    result = client.result(client.wait(client.submit(dataset, {"nodes": 16}).id).volume)
    assert result.axes == ("x", "y")
    assert result.speed.max() == 1540.0
    assert set(result.values) == {"speed", "coverage"}
    np.testing.assert_allclose(result.coordinates["x"], -0.01 + 1e-3 * np.arange(16))
    assert result.units == {"speed": "m/s", "coverage": "m"}
    assert result.attributes["bentray"] == "test"
    assert result.attributes["title"] == "Sixteen elements"
    assert result.attributes["id"].startswith("vol-")
    assert result.settings.nodes == 16


def run(serve, call):
    async def within():
        async with AsyncClient(serve(), poll_s=0.02) as client:
            return await call(client)

    return asyncio.run(within())


def test_the_whole_path_in_an_event_loop(serve, work, scan, tmp_path):
    sent, seen = [], []

    async def call(client):
        dataset = await client.upload(scan(), lambda done, total: sent.append((done, total)))
        job = await client.submit(dataset.id, {"nodes": 16, "iterations": 2})
        done = await client.wait(job.id, seen.append)
        assert (await client.job(job.id)).state == "succeeded"
        assert (await client.volume(done.volume)).shape == [16, 16]
        assert (await client.slice_png(done.volume)).startswith(b"\x89PNG")
        await client.download(done.volume, "npy", tmp_path / "speed.npy")
        result = await client.result(done.volume)
        await client.delete(dataset.id)
        with pytest.raises(ClientError) as gone:
            await client.volume(done.volume)
        assert gone.value.status == 404
        return dataset, done, result

    dataset, done, result = run(serve, call)
    assert sent[-1] == (dataset.bytes, dataset.bytes)
    assert seen[-1] == done
    assert result.values["speed"].shape == (16, 16)
    assert (tmp_path / "speed.npy").stat().st_size > 0

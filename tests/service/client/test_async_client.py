"""The client for event loops: the same calls give the same."""

import asyncio

import pytest

from bentray_service.client import AsyncClient, ClientError


def run(serve, call):
    async def within():
        async with AsyncClient(serve(), poll_s=0.02) as client:
            return await call(client)

    return asyncio.run(within())


def test_whole_path(serve, work, scan, tmp_path):
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

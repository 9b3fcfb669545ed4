"""Batches through the client: started, waited for, cancelled, listed."""

import asyncio

import pytest

from bentray_service.client import AsyncClient, Client, ClientError

QUICK = {"method": "sart", "nodes": 16, "iterations": 1}


def test_one_progress_for_many_scans(serve, scan, work):
    address = serve()
    with Client(address, poll_s=0.02) as client:
        datasets = [
            client.upload(scan(lambda file, one=one: file.attrs.update(title=one), f"{one}.h5"))
            for one in ("a", "b")
        ]
        seen = []
        batch = client.submit_batch(datasets, {"nodes": 99}, name="Two", **QUICK)
        assert (batch.settings["nodes"], batch.settings["iterations"]) == (16, 1)
        done = client.wait_batch(batch, lambda one: seen.append(one.progress))
        assert (done.state, done.counts, seen[-1]) == ("succeeded", {"succeeded": 2}, 1.0)
        assert seen == sorted(seen)
        assert [batch.id for batch in client.batches()] == [batch.id]
        assert client.batch(batch.id).jobs[0].volume is not None
        work.hold.clear()
        batch = client.submit_batch(datasets[:1], **QUICK)
        with pytest.raises(ClientError, match="is still"):
            client.wait_batch(batch, timeout_s=0.05)
        client.cancel_batch(batch)
        work.hold.set()
        assert client.wait_batch(batch.id).state == "cancelled"

    async def go():
        async with AsyncClient(address) as client:
            return [batch.state for batch in await client.batches(1)]

    assert asyncio.run(go()) == ["cancelled"]

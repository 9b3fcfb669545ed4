"""Uploads in one request wait for their turn, among those of all tenants, and leave it with their client."""

import asyncio
import threading
from contextlib import ExitStack

import pytest
from starlette.requests import ClientDisconnect, Request

from bentray_service.errors import Busy
from bentray_service.ingest.fair_queue import FairQueue
from bentray_service.ingest.upload_limits import MAX_PER_ACCOUNT
from bentray_service.routes.uploads import one_shot_uploads
from bentray_service.routes.uploads.one_shot_uploads import run_in_turn
from bentray_service.rows.ids import LOCAL, Tenant

from ...conftest import NoProjects

HDF5 = {"Content-Type": "application/x-hdf5"}
PATIENCE_S = 60.0


class Blockers:
    """Work of another tenant that takes all that one may have."""

    def __init__(self, queue, count):
        self._go, self._began = threading.Event(), threading.Semaphore(0)
        self._futures = [queue.submit(Tenant("busy"), self._hold) for _ in range(count)]
        for _ in range(min(count, queue.share)):
            assert self._began.acquire(timeout=PATIENCE_S)

    def _hold(self):
        self._began.release()
        assert self._go.wait(PATIENCE_S)

    def end(self):
        self._go.set()
        for future in self._futures:
            future.result(PATIENCE_S)


@pytest.fixture
def queue():
    """A queue that another tenant keeps busy."""
    made = FairQueue(1, NoProjects())
    made.start()
    blockers = Blockers(made, 1)
    yield made
    blockers.end()
    made.stop()


def test_an_upload_is_read_while_another_tenant_has_four_large_ones(http, uploaded):
    blockers = Blockers(http.app.state.background.ingest.queue, 4)
    try:
        uploaded(http)
    finally:
        blockers.end()


def test_disconnected_client_leaves_the_queue(queue):
    done = []

    async def ask():
        left = asyncio.Event()

        async def receive():
            await left.wait()
            return {"type": "http.disconnect"}

        waiting = asyncio.create_task(
            run_in_turn(Request({"type": "http"}, receive), queue, LOCAL, lambda: done.append("read"))
        )
        while not queue.waiting(LOCAL):
            await asyncio.sleep(0)
        left.set()
        with pytest.raises(ClientDisconnect):
            await waiting

    asyncio.run(ask())
    assert queue.waiting(LOCAL) == 0
    assert done == []


def test_long_wait_is_rejected_with_503(queue, monkeypatch):
    monkeypatch.setattr(one_shot_uploads, "LONGEST_WAIT_S", 0.01)

    async def ask():
        request = Request({"type": "http"}, asyncio.Event().wait)
        with pytest.raises(Busy, match=r"no turn in 0\.01 s"):
            await run_in_turn(request, queue, LOCAL, dict)

    asyncio.run(ask())
    assert queue.waiting(LOCAL) == 0


def test_too_many_uploads_get_retry_after(http, scan, uploaded):
    limits = http.app.state.background.ingest.upload_limits
    with ExitStack() as stack:
        for _ in range(MAX_PER_ACCOUNT):
            stack.enter_context(limits(LOCAL))
        answer = http.post("/v1/datasets", content=scan().read_bytes(), headers=HDF5)
        assert (answer.status_code, answer.headers["retry-after"]) == (429, "10")
        assert answer.json()["field"] == "uploads"
    uploaded(http)

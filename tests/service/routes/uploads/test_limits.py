"""Limits of uploads: size, arrays, turns; oversize input is rejected before it is read."""

import asyncio
import math
import threading
from contextlib import ExitStack

import h5py
import numpy as np
import pytest
from sqlalchemy import text
from starlette.requests import ClientDisconnect, Request

from bentray_kernels.requests.limits import ELEMENTS, EMISSIONS, SAMPLES, SLICES
from bentray_service.errors import Busy
from bentray_service.ingest.fair_queue import FairQueue
from bentray_service.ingest.ingest_process import convert_upload
from bentray_service.ingest.upload_ingest import MAX_PER_ACCOUNT
from bentray_service.routes.uploads import one_shot_uploads
from bentray_service.routes.uploads.one_shot_uploads import run_in_turn
from bentray_service.rows.ids import LOCAL, Tenant

from ....memory_program import peak_of
from ....raw_http import exchange
from ...conftest import NoProjects


def packed(path, shape, dtype="f8", chunk=None):
    """A change that puts an array of zeros there, packed well: it is large only once it is read."""

    def change(file):
        if path in file:
            del file[path]
        chunks = chunk or (min(shape[0], 2**22 // math.prod(shape[1:])), *shape[1:])
        made = file.create_dataset(path, shape, dtype, compression="gzip", chunks=chunks)
        # One chunk, as often as it is needed: to pack them all would take longer than to refuse them.
        made[: chunks[0]] = np.zeros((), dtype)
        mask, raw = made.id.read_direct_chunk((0,) * len(shape))
        for k in range(0, shape[0], chunks[0]):
            made.id.write_direct_chunk((k, *(0,) * (len(shape) - 1)), raw, mask)

    return change


@pytest.mark.parametrize(
    ("place", "shape", "said"),
    [
        ("geometry/element_position_m", (2**27, 2), f"134217728 elements.*at most {ELEMENTS.most}"),
        ("geometry/element_normal", (2**25, 2), f"33554432 elements.*at most {ELEMENTS.most}"),
        ("acquisition/tx", (2**25,), f"33554432 emissions.*at most {EMISSIONS.most}"),
        ("acquisition/rx", (70_000,), f"70000 receivers.*at most {EMISSIONS.most}"),
        ("slice/z_m", (5000,), f"5000 slices.*at most {SLICES.most}"),
        ("acquisition/wavelet", (2**24,), f"16777216 samples.*at most {SAMPLES.most}"),
        ("mask/valid", (2**20, 1024), "1073741824 pairs.*at most 536870912"),
    ],
)
def test_it_is_rejected_by_its_name_its_number_and_the_limit(scan, tmp_path, place, shape, said):
    path = scan(packed(place, shape, "i4" if place in ("acquisition/tx", "mask/valid") else "f8"))
    assert path.stat().st_size < 8 * 2**20
    answers = []
    # HDF5 reads by itself, but into arrays of NumPy, which are counted.
    assert peak_of(lambda: answers.append(convert_upload("dataset", path, tmp_path / "o.h5", {}))) < 2**23
    error = answers[0]["error"]
    assert error["field"] == place
    result, accepted = said.split(".*")
    assert error["found"].startswith(result)
    assert error["accepted"].startswith(accepted)
    assert not (tmp_path / "out.h5").exists()


def test_an_array_that_its_pairs_have_no_room_for_is_not_read(scan, tmp_path):
    path = scan(packed("traveltime/delta_tof_s", (4096, 4096), chunk=(512, 4096)))
    error = convert_upload("dataset", path, tmp_path / "out.h5", {})["error"]
    assert error == {
        "field": "traveltime/delta_tof_s",
        "found": "shape (4096, 4096)",
        "accepted": "shape (16, 16)",
    }


def test_a_job_is_planned_without_its_file(http, uploaded, submitted, work, monkeypatch):
    dataset = uploaded(http)

    def opened(*_):
        raise AssertionError("the file was opened")

    monkeypatch.setattr(h5py, "File", opened)
    plan = submitted(http, dataset)["plan"]
    assert plan["tasks"] > 0
    monkeypatch.undo()
    # Of one from before counts were kept the file is read.
    with http.app.state.stores.datasets._database.write() as connection:
        connection.execute(text("UPDATE datasets SET counts = NULL"))
    assert submitted(http, dataset)["plan"] == plan


@pytest.mark.parametrize("rate", [1e300, 1e-300, 5e-324, -1e6, 25.0])
def test_rejects_implausible_sampling_rates(scan, tmp_path, rate):
    def change(file):
        file["acquisition"].attrs["sampling_rate_hz"] = rate

    error = convert_upload("dataset", scan(change), tmp_path / "out.h5", {})["error"]
    assert error["field"] == "acquisition@sampling_rate_hz"
    assert error["accepted"].endswith("Hz")


@pytest.mark.parametrize(
    ("path", "media_type"),
    [
        ("/v1/jobs", "application/json"),
        ("/v1/plans", "application/json"),
        ("/v1/batches", "application/json"),
        ("/v1/datasets", "application/x-hdf5"),
        ("/v1/volumes?spacing_m=0.001", "application/octet-stream"),
        ("/v1/meshes", "application/octet-stream"),
    ],
)
def test_a_body_that_is_announced_too_large_is_not_waited_for(serve, path, media_type) -> None:
    port = int(serve(max_upload_bytes=10**6, max_tenant_bytes=10**7).rpartition(":")[2])
    head = [f"POST {path} HTTP/1.1", f"Content-Type: {media_type}", f"Content-Length: {10**13}"]
    statuses, answer = exchange(port, head, b"{", ends=False)
    assert statuses == [413], answer
    assert b"10000000000000 bytes" in answer


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

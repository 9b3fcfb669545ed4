"""Pictures beside other requests: they hold no thread, take turns, end with their client, fit a worker."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from types import SimpleNamespace

import httpx
import pytest

from bentray_service.app import create_app
from bentray_service.rows.ids import Tenant
from bentray_service.settings import ServiceSettings

from .conftest import FakeCluster, refused
from .stored_volumes import store_volume

SMALL = {"width": 32, "height": 24, "iso": 0.5}
# More than the threads that requests share.
MANY = 45
PATIENCE_S = 90.0


class Held:
    """A task that ends when the test says so."""

    def __init__(self, cluster, work):
        self._done = cluster.pool.submit(self._run, cluster, work)
        self.released = False

    def _run(self, cluster, work):
        assert cluster.gate.wait(PATIENCE_S)
        return work()

    @property
    def status(self):
        return "error" if self._done.exception() else "finished"

    def add_done_callback(self, tell):
        self._done.add_done_callback(lambda _: tell(self))

    def result(self, timeout):
        return self._done.result(timeout)

    def release(self):
        self.released = True


class HeldCluster(FakeCluster):
    """Tasks wait while the gate is shut."""

    def __init__(self):
        super().__init__()
        self.gate = threading.Event()
        self.pool = ThreadPoolExecutor(4)
        self.futures, self.names = [], []

    def submit(self, task, *given, **how):
        for name in ("workers", "resources", "priority", "pure"):
            how.pop(name)
        self.names.append(task.__name__)
        self.futures.append(Held(self, lambda: task(*given, **how)))
        return self.futures[-1]


@pytest.fixture
def held():
    made = HeldCluster()
    yield made
    made.gate.set()
    made.pool.shutdown()


@asynccontextmanager
async def service(folder, cluster):
    """The application, clients of two tenants, and the address of a volume of each."""
    settings = ServiceSettings(data_dir=folder, trusted_proxies="127.0.0.1", renders_per_minute=0)
    app = create_app(settings, cluster)

    def client(user):
        transport = httpx.ASGITransport(app, client=("127.0.0.1", 1))
        who = {"X-Forwarded-User": user}
        return httpx.AsyncClient(transport=transport, base_url="http://localhost", headers=who)

    async with app.router.lifespan_context(app), client("anna") as anna, client("bert") as bert:
        who = [(await one.get("/v1/access")).json()["tenant"] for one in (anna, bert)]
        there = [store_volume(SimpleNamespace(app=app), tenant=Tenant(name)) for name in who]
        yield app, (anna, f"/v1/volumes/{there[0]}"), (bert, f"/v1/volumes/{there[1]}")


async def until(happens):
    async with asyncio.timeout(PATIENCE_S):
        while not happens():
            await asyncio.sleep(0.01)


def test_pictures_do_not_block_request_threads(tmp_path, held):
    async def go():
        async with service(tmp_path, held) as (app, (anna, here), (bert, there)):
            asked = [
                asyncio.create_task(
                    anna.get(f"{here}/refraction.png", params={**SMALL, "index": 1.1 + k / 100})
                )
                for k in range(MANY)
            ]
            await until(lambda: held.futures)
            async with asyncio.timeout(PATIENCE_S):
                assert (await bert.get("/health/live")).status_code == 200
                assert (await bert.get("/health/ready")).status_code == 200
                assert (await bert.get("/v1/access")).status_code == 200
                assert (await bert.head(f"{there}/slice.png")).status_code == 200
            # One worker has one task; the others have not been handed out.
            assert len(held.futures) == 1
            late = asyncio.create_task(bert.get(f"{there}/slice.png"))
            await until(lambda: len(app.state.background.pictures._queue.waiting()) == 2)
            held.gate.set()
            assert (await late).status_code == 200
            # Only the one that had begun already came before.
            assert held.names[:2] == ["picture_png", "volume_slice_png"]
            answers = await asyncio.gather(*asked)
            assert {answer.status_code for answer in answers} == {200}

    asyncio.run(go())


def test_a_picture_ends_with_its_client(tmp_path, held):
    async def go():
        async with service(tmp_path, held) as (app, (anna, here), _):
            gone, came = asyncio.Event(), asyncio.Event()

            async def receive():
                if not came.is_set():
                    came.set()
                    return {"type": "http.request", "body": b"", "more_body": False}
                await gone.wait()
                return {"type": "http.disconnect"}

            async def send(message):
                """Nobody reads it."""

            scope = {
                "type": "http",
                "method": "GET",
                "path": f"{here}/slice.png",
                "raw_path": f"{here}/slice.png".encode(),
                "query_string": b"",
                "headers": [(b"host", b"localhost"), (b"x-forwarded-user", b"anna")],
                "client": ("127.0.0.1", 1),
                "server": ("localhost", 80),
                "scheme": "http",
                "root_path": "",
                "http_version": "1.1",
                "asgi": {"version": "3.0"},
            }
            asked = asyncio.create_task(app(scope, receive, send))
            await until(lambda: held.futures)
            assert not held.futures[0].released
            gone.set()
            await asked
            assert held.futures[0].released
            # Its worker is free for the next one.
            held.gate.set()
            assert (await anna.get(f"{here}/slice.png")).status_code == 200

    asyncio.run(go())


@pytest.mark.parametrize(
    "what", ["refraction.png?iso=0.5", "slice.png", "data?format=npy", "data?format=nifti"]
)
def test_rejects_pictures_larger_than_worker_memory(http, cluster, what):
    """Tasks of 128 MiB, and a volume of 150 MiB."""
    cluster.memory_bytes = 2**29 + 2**27
    volume = store_volume(http, shape=(340, 340, 340))
    answer = http.get(f"/v1/volumes/{volume}/{what}")
    body = answer.json()
    assert (answer.status_code, body["type"]) == (422, "/problems/invalid-input"), body
    assert "bytes of a worker" in body["found"]
    assert "at most 134217728 bytes" in body["accepted"]
    assert not cluster.submitted
    asked = {"kind": "refraction", "volume": volume, "settings": {"iso": [0.5]}}
    refused(http.post("/v1/jobs", json=asked), "volume")


def test_a_large_picture_has_its_worker_to_itself(http, cluster):
    cluster.memory_bytes = 2**30
    for shape, lanes in (((180, 180, 180), {"render": 1, "recon": 1}), (None, {"render": 1})):
        here = f"/v1/volumes/{store_volume(http, shape=shape)}/refraction.png"
        assert http.get(here, params=SMALL).status_code == 200
        assert cluster.submitted[-1]["resources"] == lanes

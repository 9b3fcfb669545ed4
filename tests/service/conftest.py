"""A small scan, a light cluster, a reconstruction on a lead, and services started with them."""

from __future__ import annotations

import io
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
import uvicorn

from bentray_kernels.task_graph import Cancelled
from bentray_kernels.tomography.result import Candidate, Iteration, Progress, Reconstruction
from bentray_kernels.tomography.settings import Settings
from bentray_service.app import create_app
from bentray_service.ingest import canonical
from bentray_service.ingest.ingest_process import convert_upload
from bentray_service.ingest.sandbox import summary_in
from bentray_service.rows.accounts import Account, Accounts
from bentray_service.rows.ids import Tenant
from bentray_service.rows.keys import ApiKey, Keys
from bentray_service.settings import ServiceSettings
from bentray_service.web.server import configuration, listen
from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.cluster.fair_shares import Share
from bentray_workers.reconstruction import reconstruction_run

from ..waiting import wait_until

with warnings.catch_warnings():
    # Starlette's test client would rather have httpx2; our own client is written for httpx.
    warnings.simplefilter("ignore", UserWarning)
    from fastapi.testclient import TestClient


HDF5 = {"Content-Type": "application/x-hdf5"}
STREAM = {"Content-Type": "application/octet-stream"}


ENDED = ("succeeded", "failed", "cancelled")
# What takes longer hangs: a job may have to compile its kernels first, on a machine that is busy.
PATIENCE_S = 240.0


def npy(values: np.ndarray) -> bytes:
    """The bytes of a file of NumPy."""
    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=True)
    return buffer.getvalue()


def signed(
    http: TestClient,
    tenant: str = "local",
    scopes: tuple[str, ...] = ("read", "write"),
    expires: float | None = None,
) -> dict[str, str]:
    """Headers with a new key of a tenant."""
    token = ApiKey.new()
    keys = Keys(http.app.state.stores.database)
    keys.add(token, Tenant(tenant), f"scanner of {tenant}", scopes, expires)
    return {"Authorization": f"Bearer {token.shown()}"}


def created(answer: Any, status: int = 201) -> dict[str, Any]:
    """The record in an answer with that status."""
    assert answer.status_code == status, answer.text
    return dict(answer.json())


def refused(answer: Any, field: str, accepted: str = "", status: int = 422) -> dict[str, Any]:
    """The problem by which a request was refused: its status, the field at fault, and what is accepted."""
    body = dict(answer.json())
    assert answer.headers["content-type"] == "application/problem+json"
    assert (answer.status_code, body["status"], body["field"]) == (status, status, field), body
    assert body["found"], body
    assert body["accepted"], body
    assert accepted in body["accepted"], body
    return body


def made_once(http: TestClient, cluster: FakeCluster, here: str) -> None:
    """Check that a picture is made once for its tag, and by no request for its head."""
    submitted = len(cluster.submitted)
    assert http.get(here, headers={"If-None-Match": "*"}).status_code == 304
    assert len(cluster.submitted) == submitted
    whole = http.get(here)
    assert whole.headers["cache-control"] == "private, no-cache"
    submitted, tag = len(cluster.submitted), whole.headers["etag"]
    for ask in (http.get, http.head):
        known = ask(here, headers={"If-None-Match": tag})
        assert (known.status_code, known.content, known.headers["etag"]) == (304, b"", tag)
    head = http.head(here)
    assert (head.status_code, head.content) == (200, b"")
    same = ("etag", "content-type", "cache-control")
    assert [head.headers[name] for name in same] == [whole.headers[name] for name in same]
    # The body would have that length, which nobody knows yet.
    assert "content-length" not in head.headers
    assert len(cluster.submitted) == submitted
    wrong = http.delete(here)
    assert (wrong.status_code, wrong.headers["allow"]) == (405, "GET, HEAD")


class NoProjects(Accounts):
    """Accounts without a database: each tenant is its own."""

    def __init__(self) -> None: ...

    def of(self, tenant: Tenant) -> Account:
        return Account(tenant)


class FakeFuture:
    """The result of a task that has run already."""

    def __init__(self, value: Any) -> None:
        self._value = value
        self.status = "error" if isinstance(value, Exception) else "finished"

    def add_done_callback(self, tell: Callable[[FakeFuture], None]) -> None:
        tell(self)

    def result(self, timeout: float) -> Any:
        if isinstance(self._value, Exception):
            raise self._value
        return self._value

    def release(self) -> None:
        """Nothing is held."""


def _known(given: Any) -> Any:
    """What a task is given: results in place of the futures in a list, as Dask does it."""
    return [one.result(0.0) for one in given] if isinstance(given, list) else given


class FakeCluster:
    """A cluster that runs every task at once, in the calling thread; remembers what was asked of it."""

    def __init__(self) -> None:
        self.workers = 1
        self.memory_bytes = 0
        self.lanes = {"recon": 1, "render": 1}
        self.closed = False
        self.submitted: list[dict[str, Any]] = []

    @property
    def client(self) -> FakeCluster:
        return self

    def submit(self, task: Callable[..., Any], *given: Any, **how: Any) -> FakeFuture:
        # Which worker it is does not matter here.
        del how["workers"]
        self.submitted.append(dict(how))
        for name in ("resources", "priority", "pure"):
            how.pop(name)
        try:
            return FakeFuture(task(*map(_known, given), **how))
        except Exception as error:
            return FakeFuture(error)

    def describe(self) -> dict[str, Any]:
        return {"workers": self.workers}

    @property
    def cluster(self) -> None:
        """It was not started for us."""

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        one = {"memory_limit": self.memory_bytes, "resources": self.lanes}
        return {"workers": {str(k): one for k in range(self.workers)}}

    scheduler = SimpleNamespace(run_function=None)

    def sync(self, *_given: Any, **_how: Any) -> dict[str, Any]:
        """The scheduler answers with its load."""
        return {"status": "OK", "result": {"tasks": 0, "waiting_tasks": 0, "memory_bytes": 1}}

    def close(self) -> None:
        self.closed = True


class FakeWork:
    """In place of ``slices.reconstruct``: waits while ``hold`` is clear, raises ``error`` if there is one."""

    def __init__(self) -> None:
        self.calls: list[tuple[Path, Settings]] = []
        self.hold = threading.Event()
        self.hold.set()
        # Set once the work of a job begins; its row says "running" before.
        self.begun = threading.Event()
        self.error: Exception | None = None
        # Of one node, in place of its speed.
        self.spoil: float | None = None
        self.stages = 1
        self.trials: tuple[Candidate, ...] = ()

    def __call__(
        self,
        client: Any,
        path: Path,
        settings: Settings,
        on_progress: Callable[[Progress], None],
        stop: Callable[[], bool],
        work_dir: Path,
        on_saved: Callable[[], None],
        share: Share,
    ) -> Reconstruction:
        self.calls.append((path, settings))
        assert work_dir.is_dir()
        self.begun.set()
        history: tuple[Iteration, ...] = ()
        passes = [(stage, n) for stage in range(self.stages) for n in range(1, settings.iterations + 1)]
        on_progress(Progress(0, 8 * len(passes)))
        for stage, sweep in passes:
            while True:
                if stop():
                    raise Cancelled
                if self.hold.wait(0.01):
                    break
            history += (Iteration(0, sweep, 2e-6 / sweep, 8, stage),)
            on_saved()
            on_progress(Progress(8 * len(history), 8 * len(passes), history))
        if self.error is not None:
            raise self.error
        x = np.linspace(-1.0, 1.0, settings.nodes or 32)
        speed = 1500.0 + 40.0 * (x[:, None] ** 2 + 0.5 * x[None, :] < 0.3)
        if self.spoil is not None:
            speed[0, 0] = self.spoil
        return Reconstruction(
            speed=speed,
            coverage=np.ones_like(speed),
            spacing_m=(1e-3, 1e-3),
            origin_m=(-0.01, -0.01),
            water_speed_mps=1500.0,
            settings=replace(settings, method="sart") if settings.method == "auto" else settings,
            history=history,
            trials=self.trials,
            provenance={"bentray": "test"},
        )


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> FakeWork:
    """A reconstruction that the test holds and lets go."""
    fake = FakeWork()
    monkeypatch.setattr(reconstruction_run, "reconstruct", fake)
    return fake


@pytest.fixture
def cluster() -> FakeCluster:
    return FakeCluster()


@pytest.fixture(autouse=True)
def convert_in_this_process(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Convert uploads without a process for each: its start takes most of the time of a test.

    With the marker ``ingest_process`` they have one, as in the service.
    """

    if request.node.get_closest_marker("ingest_process") is None:
        monkeypatch.setattr(canonical, "ingest", ingest_here)


def ingest_here(
    what: str, source: Path, target: Path, *, given: Any, reserve: Callable[[int], None], **_: Any
) -> dict[str, Any]:
    """In place of ``canonical.ingest``: in this process."""
    return summary_in(convert_upload(what, source, target, dict(given), reserve))


@pytest.fixture
def scan(tmp_path: Path) -> Callable[..., Path]:
    """Write the small scan; ``change(file)`` spoils it."""

    def write(change: Callable[[h5py.File], None] | None = None, name: str = "scan.h5") -> Path:
        return write_scan(tmp_path / name, change)

    return write


def write_scan(path: Path, change: Callable[[h5py.File], None] | None = None) -> Path:
    """Write a ring of 16 elements with straight travel times."""
    angle = 2 * np.pi * np.arange(16) / 16
    position = 0.05 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    with h5py.File(path, "w") as file:
        file.attrs.update(
            format="uct-transmission", format_version="1.0", dimension=2, title="Sixteen elements"
        )
        file.create_group("geometry").attrs.update(array_type="ring", radius_m=0.05)
        file["geometry/element_position_m"] = position
        file.create_group("acquisition").attrs.update(center_frequency_hz=1e6, t0_s=0.0)
        file["acquisition/tx"] = np.arange(16)
        file["acquisition/rx"] = np.arange(16)
        file.create_group("water").attrs["sound_speed_mps"] = 1500.0
        distance = np.linalg.norm(position[:, None] - position[None], axis=-1)
        file["traveltime/delta_tof_s"] = -0.02 * distance / 1500.0
        if change is not None:
            change(file)
    return path


@pytest.fixture
def start(tmp_path: Path, cluster: FakeCluster) -> Iterator[Callable[..., TestClient]]:
    """Start the application in this process; ``folder`` names its data folder, to start on it again."""
    with ExitStack() as stack:

        def go(folder: str = "data", **settings: Any) -> TestClient:
            own = settings.pop("cluster", cluster)
            app = create_app(ServiceSettings(data_dir=tmp_path / folder, **settings), own)
            return stack.enter_context(
                TestClient(app, base_url="http://localhost", raise_server_exceptions=False)
            )

        yield go


@pytest.fixture
def http(start: Callable[..., TestClient]) -> TestClient:
    """The application with its default settings."""
    return start()


@pytest.fixture
def uploaded(scan: Callable[..., Path]) -> Callable[[TestClient], str]:
    """Upload the small scan; returns its id."""
    return lambda http: created(http.post("/v1/datasets", content=scan().read_bytes(), headers=HDF5))["id"]


@pytest.fixture
def submitted() -> Callable[..., dict[str, Any]]:
    """Queue a reconstruction; returns the job record."""

    def send(http: TestClient, dataset: str, **settings: Any) -> dict[str, Any]:
        asked = {
            "kind": "reconstruction",
            "dataset": dataset,
            "settings": {"method": "sart", "nodes": 16, "iterations": 3, **settings},
        }
        return created(http.post("/v1/jobs", json=asked), 202)

    return send


@pytest.fixture
def running(
    uploaded: Callable[..., str], submitted: Callable[..., Any], until: Callable[..., Any], work: FakeWork
) -> Callable[..., dict[str, Any]]:
    """Start a reconstruction that runs until ``work.hold`` is set; returns its record."""

    def begin(http: TestClient) -> dict[str, Any]:
        work.hold.clear()
        return dict(until(http, submitted(http, uploaded(http))["id"], "running"))

    return begin


@pytest.fixture
def until() -> Callable[..., dict[str, Any]]:
    """Poll a job until it is in one of some states (any end by default); returns its record."""

    def poll(http: TestClient, job_id: str, *states: str) -> dict[str, Any]:
        wanted = states or ENDED
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            job = dict(http.get(f"/v1/jobs/{job_id}").json())
            if job["state"] in wanted:
                return job
            time.sleep(0.02)
        raise AssertionError(f"{job['state']} is not {wanted} after {PATIENCE_S} s: {job}")

    return poll


@pytest.fixture
def serve(tmp_path: Path, cluster: FakeCluster) -> Iterator[Callable[..., str]]:
    """Start the service behind a real socket; returns its address."""
    with ExitStack() as stack:

        def go(**settings: Any) -> str:
            given = ServiceSettings(data_dir=tmp_path / "served", **settings)
            return stack.enter_context(serving(given, cluster))

        yield go


@pytest.fixture(scope="module")
def workers() -> Iterator[Cluster]:
    """A cluster in this process, of one worker."""
    with open_cluster(workers=1, processes=False) as cluster:
        yield cluster


@pytest.fixture
def on_workers(tmp_path: Path, workers: Cluster) -> Callable[..., AbstractContextManager[TestClient]]:
    """Start the application on the workers; again on the same folder when it is called again."""

    @contextmanager
    def go(**settings: Any) -> Iterator[TestClient]:
        app = create_app(ServiceSettings(data_dir=tmp_path / "data", **settings), workers)
        with TestClient(app, base_url="http://localhost", raise_server_exceptions=False) as http:
            yield http

    return go


@contextmanager
def serving(settings: ServiceSettings, cluster: FakeCluster, port: int = 0) -> Iterator[str]:
    """A service behind a real socket; gives its address, and stops it as by SIGTERM."""
    app = create_app(settings, cluster)
    server, listening = uvicorn.Server(configuration(app)), listen("127.0.0.1", port)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    try:
        wait_until(lambda: server.started or not thread.is_alive(), PATIENCE_S)
        assert thread.is_alive()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
    finally:
        # As ``bentray serve`` does: streams of events end first.
        app.state.leaving.set()
        server.should_exit = True
        thread.join(PATIENCE_S)
        assert not thread.is_alive()

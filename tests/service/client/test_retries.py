"""Retries of the client: only idempotent requests, bounded, while the service is away."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import tenacity
from tenacity import Retrying

from bentray_service.client import AsyncClient, Client, ClientError, connection, flows, uploading
from bentray_service.client.connection import Connection, DownloadStep, RequestStep, Retries
from bentray_service.client.errors import NoAnswer
from bentray_service.settings import ServiceSettings

from ...free_ports import free_port
from ...waiting import wait_until
from ..conftest import serving
from .cutting_proxy import cutting

LOOK = RequestStep("GET", "/v1/jobs/job-1", repeatable=True)
CANCEL = RequestStep("POST", "/v1/jobs/job-1/cancel")
GONE, REFUSED = NoAnswer("gone"), NoAnswer("refused", sent=False)

HERE = Connection("http://localhost:8000")


def answered(status: int, retry_after_s: float | None = None) -> ClientError:
    error = ClientError(f"status {status}", status)
    error.retry_after_s = retry_after_s
    return error


class Walk:
    """A client whose answers are given, and whose clock only pauses move."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, told: list[str] | None = None, first: Any = "first"
    ) -> None:
        self.now, self.pauses, self.told = 1000.0, [], [] if told is None else told
        clock = SimpleNamespace(monotonic=lambda: self.now)
        for module in (connection, tenacity):
            monkeypatch.setattr(module, "time", clock)
        self._retries = Retries(300.0, self.told.append)
        self.ask(LOOK, first)

    def _pause(self, seconds: float) -> None:
        self.now += seconds
        self.pauses.append(seconds)

    def ask(self, step: Any, *answers: Any) -> Any:
        """The value of a step that gets these answers, errors among them."""
        left = iter(answers)

        def request() -> Any:
            answer = next(left, GONE)
            if isinstance(answer, Exception):
                raise answer
            return answer

        answer = Retrying(sleep=self._pause, **self._retries.options(step))(request)
        assert next(left, None) is None, "an answer was not asked for"
        return answer


@pytest.fixture
def walk(monkeypatch: pytest.MonkeyPatch) -> Walk:
    return Walk(monkeypatch)


def test_retries_back_off_and_log_once(walk: Walk) -> None:
    away = [REFUSED, GONE, answered(502), answered(503), answered(504), answered(500)]
    assert walk.ask(LOOK, *away, "here") == "here"
    assert walk.pauses == [0.5, 1.0, 2.0, 4.0, 8.0, 15.0]
    assert walk.told == ["refused; retrying for up to 300 s.", "The service answers again."]


def test_retries_honour_retry_after(walk: Walk) -> None:
    walk.ask(LOOK, answered(503, 5.0), "here")
    assert walk.pauses == [5.0]


def test_it_ends(walk: Walk) -> None:
    with pytest.raises(NoAnswer, match="gone"):
        walk.ask(LOOK)
    assert 280.0 < sum(walk.pauses) <= 300.0
    with pytest.raises(ClientError, match="500"):
        walk.ask(LOOK, *[answered(500)] * connection.MAX_ERRORS)


def test_wait_timeout_is_honoured(walk: Walk) -> None:
    with pytest.raises(NoAnswer):
        walk.ask(RequestStep("GET", "/", repeatable=True, until=walk.now + 10.0))
    assert sum(walk.pauses) <= 10.0


def test_service_that_never_answered_fails_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    with pytest.raises(NoAnswer, match="refused"):
        Walk(monkeypatch, told, first=REFUSED)
    assert told == []


@pytest.mark.parametrize("error", [GONE, answered(500), answered(503)])
def test_non_idempotent_requests_are_not_repeated(walk: Walk, error: ClientError) -> None:
    with pytest.raises(ClientError):
        walk.ask(CANCEL, error)
    assert walk.pauses == []
    assert walk.ask(CANCEL, REFUSED, REFUSED, "cancelled") == "cancelled"


@pytest.mark.parametrize("status", [401, 404, 409, 413, 422, 429, 501])
def test_a_refusal_is_no_absence(walk: Walk, status: int) -> None:
    with pytest.raises(ClientError):
        walk.ask(LOOK, answered(status))
    assert walk.pauses == []


def test_a_download_begins_again(walk: Walk, tmp_path: Path) -> None:
    walk.ask(DownloadStep("/v1/volumes/vol-1/data", {}, tmp_path / "v.h5"), GONE, answered(503), None)
    assert len(walk.pauses) == 2


def test_a_job_has_one_key_however_often_it_is_sent() -> None:
    step = next(flows.submit(HERE, "ds-1"))
    assert isinstance(step, RequestStep)
    assert step.repeatable
    other = next(flows.submit(HERE, "ds-1"))
    assert isinstance(other, RequestStep)
    assert step.options["headers"]["Idempotency-Key"] != other.options["headers"]["Idempotency-Key"]


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "FIRST_PAUSE_S", 0.05)


def test_a_job_whose_answer_was_lost_is_started_once(
    serve: Callable[..., str], scan: Callable[..., Path], work: Any, soon: None
) -> None:
    """The service gets the request; the connection breaks before the answer."""
    url = serve()
    with Client(url) as client:
        dataset = client.upload(scan()).id
    cuts = [1_000]
    told: list[str] = []
    with cutting(url, cuts) as proxy, Client(proxy.url, on_wait=told.append) as client:
        with pytest.raises(ClientError, match="Unknown id"):
            client.job("job-" + 20 * "0")
        # As long as it takes to pass the cut.
        jobs = [client.submit(dataset, {"nodes": 16, "iterations": 1}).id for _ in range(4)]
    assert cuts == []
    assert told[1:] == ["The service answers again."]
    with Client(url) as client:
        listed = {client.wait(job).id for job in jobs}
    assert len(listed) == 4
    with Client(url) as client:
        answer = client._http.get("/v1/jobs").json()
    assert {job["id"] for job in answer["jobs"]} == listed


def test_an_upload_is_stored_once_wherever_the_line_breaks(
    serve: Callable[..., str], scan: Callable[..., Path], soon: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploading, "FIRST_PAUSE_S", 0.05)
    url, source = serve(), scan()
    size = source.stat().st_size
    # In the creation, in the middle of the piece, and after it.
    cuts = [400, 400 + size // 2, 1200 + size]
    with cutting(url, cuts) as proxy, Client(proxy.url) as client:
        with pytest.raises(ClientError, match="Unknown id"):
            client.job("job-" + 20 * "0")
        record = client.upload(source)
    assert cuts == []
    assert record.bytes == size
    with Client(url) as client:
        assert len(client._http.get("/v1/datasets").json()["datasets"]) == 1


def test_so_it_is_asynchronously(serve: Callable[..., str], scan: Callable[..., Path], soon: None) -> None:
    async def call(url: str, told: list[str]) -> str:
        async with AsyncClient(url, on_wait=told.append) as client:
            with pytest.raises(ClientError, match="Unknown id"):
                await client.job("job-" + 20 * "0")
            dataset = (await client.upload(scan())).id
            return str((await client.submit(dataset)).id)

    url, told = serve(), list[str]()
    cuts = [scan().stat().st_size + 1_000]
    with cutting(url, cuts) as proxy:
        assert asyncio.run(call(proxy.url, told)).startswith("job-")
    assert cuts == []


def test_a_job_is_waited_for_while_its_service_is_started_again(
    scan: Callable[..., Path], work: Any, cluster: Any, tmp_path: Path, soon: None
) -> None:
    told: list[str] = []
    with ThreadPoolExecutor(1) as pool:
        work.hold.clear()
        settings, port = ServiceSettings(data_dir=tmp_path / "data"), free_port()
        with serving(settings, cluster, port) as url:
            client = Client(url, poll_s=0.05, on_wait=told.append)
            job = client.submit(client.upload(scan()).id, {"nodes": 16, "iterations": 1}).id
            done = pool.submit(client.wait, job)
            wait_until(lambda: work.calls)
        wait_until(lambda: told)
        work.hold.set()
        with serving(settings, cluster, port), client:
            record = done.result(timeout=60.0)
            assert client.download(record.volume, "h5", tmp_path / "image.h5").stat().st_size > 0
    assert (record.id, record.state, len(work.calls)) == (job, "succeeded", 2)
    assert told[0].endswith("retrying for up to 300 s.")
    assert told[-1] == "The service answers again."


def test_no_patience_gives_up_at_once(serve: Callable[..., str], soon: None) -> None:
    with cutting(serve(), [400] * 1000) as proxy, Client(proxy.url, patience_s=0.0) as client:
        for _ in range(10):
            with pytest.raises(ClientError):
                client.job("job-" + 20 * "0")
        assert proxy.made < 40

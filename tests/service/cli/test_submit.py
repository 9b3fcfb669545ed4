"""`bentray submit` against a stand-in of the client (against a real service: ``test_demo``)."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest
from scipy.io import savemat

from bentray_kernels.tomography import Settings
from bentray_service.client import ClientError
from bentray_service.routes.models.job_records import JobRecord
from bentray_service.web.problem import Problem
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.reconstruction import reconstruction_run

from ...workers.foreign_scans.scans import delta_tof, positions
from .conftest import Run


class StandIn:
    """Answers as the client does, and remembers what it was asked."""

    asked: ClassVar[list[Any]] = []
    scan: ClassVar[Path]
    filename: ClassVar[str]

    def __init__(self, url: str, on_wait: Callable[[str], None]) -> None:
        self.url = url.rstrip("/")
        self.asked.append(url)

    def __enter__(self) -> StandIn:
        return self

    def __exit__(self, *ending: object) -> None:
        self.asked.append("closed")

    def upload(self, path: Path, on_progress: Callable[[int, int], None], filename: str) -> SimpleNamespace:
        on_progress(1, 2)
        StandIn.scan, StandIn.filename = path, filename
        return SimpleNamespace(id="dataset-1")

    def submit(self, dataset: str, settings: dict[str, Any], webhook: str | None = None) -> JobRecord:
        self.asked.append((dataset, settings))
        self.asked.append(webhook)
        return self.record("queued")

    def wait(self, job: str, on_progress: Callable[[JobRecord], None]) -> JobRecord:
        for state in ("queued", "running", "succeeded"):
            on_progress(self.record(state))
        return self.record("succeeded")

    def download(self, volume: str, format: str, path: Path) -> Path:  # noqa: A002
        assert (volume, format) == ("volume-1", "hdf5")
        write_reconstruction(
            path,
            reconstruction_run.reconstruct(
                None, StandIn.scan, Settings(method="sart", nodes=24, iterations=1)
            ),
        )
        return path

    def record(self, state: str) -> JobRecord:
        done = state == "succeeded"
        sweep = {"slice": 0, "sweep": 1, "residual_rms_s": 1e-7, "emitters": 24}
        given = {
            "id": "job-1",
            "kind": "reconstruction",
            "state": state,
            "settings": {},
            "progress": {"done": 24 * done, "total": 24, "phase": "picking"},
            "history": [sweep] if done else [],
            "volume": "volume-1" if done else None,
            "doubtful": False,
            "seconds": 1.5,
            "created": 0.0,
            "links": {"self": "/v1/jobs/job-1"},
        }
        texts = dict.fromkeys(("name", "title", "notes", "started_by"), "")
        return JobRecord.model_validate({**dict.fromkeys(JobRecord.model_fields), **texts, **given})


PROBLEM = Problem(
    type="", title="t", status=422, detail="", field="acquisition/tx", found="999", accepted="0 to 255"
)
REFUSED = ClientError("t", 422, PROBLEM)


@pytest.fixture
def client(monkeypatch: pytest.MonkeyPatch) -> type[StandIn]:
    monkeypatch.setattr("bentray_service.client.Client", StandIn)
    monkeypatch.setattr(StandIn, "asked", [])
    return StandIn


def test_it_sends_the_scan_and_fetches_three_files(
    bentray: Run, client: type[StandIn], scan_file: Path, tmp_path: Path
) -> None:
    result = bentray(
        "submit", scan_file, "--url", "http://lab:8000", "-o", tmp_path, "--iterations", 1, "--json"
    )
    url, (dataset, settings), _, closed = client.asked
    assert (url, dataset, closed) == ("http://lab:8000", "dataset-1", "closed")
    assert settings == Settings(iterations=1).to_dict()
    said = json.loads(result.stdout)
    assert said["job"] == "job-1"
    assert said["seconds"] == 1.5
    assert said["truth"]["rmse_mps"] > 0
    for kind in ("h5", "png", "json"):
        assert (tmp_path / f"reconstruction.{kind}").stat().st_size > 100


def test_a_scan_of_another_program_is_converted_before_it_is_sent(
    bentray: Run, client: type[StandIn], tmp_path: Path
) -> None:
    savemat(tmp_path / "own.mat", {"pos": 1e3 * positions(), "dtof": delta_tof()})
    out = tmp_path / "out"
    words = ("--map", "element_position=pos", "--map", "delta_tof=dtof", "--unit", "mm")
    result = bentray("submit", tmp_path / "own.mat", "-o", out, *words)
    assert "20 °C (1482.4 m/s) is assumed" in " ".join(result.stdout.split())
    assert not client.scan.exists(), "the converted file is removed"
    assert client.filename == "own.mat"
    assert sorted(path.suffix for path in out.iterdir()) == [".h5", ".json", ".png"]


@pytest.mark.parametrize(("words", "state"), [((), "succeeded"), (("--no-wait",), "queued")])
def test_without_a_folder_it_prints_the_job_and_its_address(
    bentray: Run, client: type[StandIn], scan_file: Path, words: tuple[str, ...], state: str
) -> None:
    result = bentray("submit", scan_file, "--url", "http://lab:8000/", *words)
    assert result.stdout == f"job-1 {state}\nhttp://lab:8000/v1/jobs/job-1\n"
    assert json.loads(bentray("submit", scan_file, *words, "--json").stdout)["state"] == state


def test_a_webhook_goes_along_without_waiting(bentray: Run, client: type[StandIn], scan_file: Path) -> None:
    words = ("--webhook", "https://hooks.example.org/x")
    bentray("submit", scan_file, "--no-wait", *words)
    assert words[1] in client.asked
    assert "--no-wait" in bentray("submit", scan_file, *words, code=2).stderr


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (
            REFUSED,
            2,
            "bentray: acquisition/tx: found 999; accepted: 0 to 255\n",
        ),
        (ClientError("no answer from http://lab"), 1, "bentray: no answer from http://lab\n"),
    ],
)
def test_a_refusal_is_one_line(
    bentray: Run,
    client: type[StandIn],
    monkeypatch: pytest.MonkeyPatch,
    scan_file: Path,
    error: ClientError,
    code: int,
    line: str,
) -> None:
    def refuse(*given: object, **named: object) -> None:
        raise error

    monkeypatch.setattr(StandIn, "upload", refuse)
    result = bentray("submit", scan_file, code=code)
    assert (result.stderr, result.stdout) == (line, "")
    assert client.asked[-1] == "closed"


def test_refused_connection_exits_with_failure(bentray: Run, scan_file: Path) -> None:
    # Port 1 of loopback: reserved, and nothing listens on it.
    result = bentray("submit", scan_file, "--url", "http://127.0.0.1:1", code=1)
    assert result.stderr.startswith("bentray: no answer from http://127.0.0.1:1")
    assert result.stderr.count("\n") == 1

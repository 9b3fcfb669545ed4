"""A service in a child process: it answers inside the block and is gone after it, however the block ends."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import httpx
import pytest

from bentray_service.cli import service_process
from bentray_service.cli.output.exit_codes import WorkFailed
from bentray_service.cli.service_process import running_service

from ...waiting import wait_until

# Says that it is there, then works until it is told to stop; the last word ignores being told.
STAND_IN = """
import json, signal, subprocess, sys, time
if "stubborn" in sys.argv:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print(json.dumps({"url": f"http://child/{child.pid}"}), flush=True)
time.sleep(600)
"""


def stand_in(monkeypatch: pytest.MonkeyPatch, code: str, *words: str) -> None:
    """Start ``code`` where the service would be started."""
    real = subprocess.Popen

    def start(command: list[str], **how: object) -> subprocess.Popen[bytes]:
        assert command[3] == "serve"
        return real([sys.executable, "-c", code, *words], **how)  # type: ignore[call-overload,no-any-return]

    monkeypatch.setattr(service_process.subprocess, "Popen", start)


def child_in(block: AbstractContextManager[str], then: Callable[[int], None]) -> None:
    """Enter a service block, do ``then`` with the process id of the stand-in's own child, and leave."""
    with block as url:
        child = int(url.rsplit("/", 1)[1])
        assert not ended(child)
        then(child)


def ended(pid: int) -> bool:
    """Whether a process has ended; a child that nobody has waited for counts as ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


@pytest.mark.parametrize("words", [(), ("stubborn",)])
def test_service_and_workers_stop_after_a_failure(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: tuple[str, ...]
) -> None:
    stand_in(monkeypatch, STAND_IN, *words)
    monkeypatch.setattr(service_process, "STOP_S", 0.5)
    seen: list[int] = []

    def fail(child: int) -> None:
        seen.append(child)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        child_in(running_service(tmp_path, tmp_path / "log"), fail)
    wait_until(lambda: ended(seen[0]))


def test_service_stops_with_its_parent(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stand_in(monkeypatch, STAND_IN)
    before = signal.getsignal(signal.SIGTERM)
    seen: list[int] = []

    def end(child: int) -> None:
        seen.append(child)
        os.kill(os.getpid(), signal.SIGTERM)

    with pytest.raises(KeyboardInterrupt):
        child_in(running_service(tmp_path, tmp_path / "log"), end)
    wait_until(lambda: ended(seen[0]))
    assert signal.getsignal(signal.SIGTERM) == before


def test_output_of_an_early_exit_is_shown(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stand_in(monkeypatch, "import sys; sys.exit('bentray: the disk is full')")
    with (
        pytest.raises(WorkFailed, match="exited at once: bentray: the disk is full"),
        running_service(tmp_path, tmp_path / "log"),
    ):
        pytest.fail("it cannot have started")


def test_unresponsive_service_times_out(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stand_in(monkeypatch, "import time; time.sleep(600)")
    monkeypatch.setattr(service_process, "START_S", 0.0)
    with pytest.raises(WorkFailed, match="did not start within"), running_service(tmp_path, tmp_path / "log"):
        pytest.fail("it cannot have started")


# `bentray demo` starts and stops one too.
@pytest.mark.slow
@pytest.mark.nightly
def test_the_real_service_answers_and_stops(tmp_path: Path) -> None:
    with running_service(tmp_path / "data", tmp_path / "log") as url:
        assert httpx.get(f"{url}/health/ready", timeout=60.0).json()["status"] == "ready"
    with pytest.raises(httpx.TransportError):
        httpx.get(f"{url}/health/live", timeout=5)
    assert "Traceback" not in (tmp_path / "log").read_text()
    assert json.dumps(url)[1:-1] in (tmp_path / "log").read_text()

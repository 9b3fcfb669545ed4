"""A scheduler, workers and a service, each a process that can be killed and started again at any time."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx

from ..free_ports import free_port

PATIENCE_S = 240.0
ENDED = ("succeeded", "failed", "cancelled")


def wait_until(so: Callable[[], Any], patience_s: float = PATIENCE_S) -> Any:
    """Value of ``so``, once there is one; a service that is away is waited for."""
    deadline = time.monotonic() + patience_s
    while True:
        try:
            if result := so():
                return result
        except httpx.TransportError:
            pass
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.05)


class Machine:
    """All parts of Bentray on this machine.

    Args:
        folder: for data and logs.
        workers: worker processes.
        environment: of the service, beside where its parts are.

    Attributes:
        data: the data folder; files: of its tenant in there.
        host: the address of the scheduler.
    """

    host = "127.0.0.1"

    def __init__(self, folder: Path, workers: int = 2, **environment: str) -> None:
        self.data = folder / "data"
        self.files = self.data / "tenants" / "local"
        self._folder = folder
        self._workers = workers
        self._scheduler_port, self._service_port = free_port(), free_port()
        self.scheduler_address = f"tcp://{self.host}:{self._scheduler_port}"
        self._environment = {
            **os.environ,
            "BENTRAY_DATA_DIR": str(self.data),
            "DASK_SCHEDULER_ADDRESS": self.scheduler_address,
            "DASK_DISTRIBUTED__SCHEDULER__HTTP__ROUTES": "[]",
            **environment,
        }
        self.http = httpx.Client(base_url=f"http://127.0.0.1:{self._service_port}", timeout=60.0)
        self.parts: dict[str, subprocess.Popen[bytes]] = {}
        for part in ("scheduler", "workers", "service"):
            self.start(part)

    def _command(self, part: str) -> list[str]:
        python = [sys.executable, "-m"]
        if part == "scheduler":
            where = ["--host", self.host, "--port", str(self._scheduler_port)]
            return [*python, "dask", "scheduler", *where, "--no-dashboard"]
        bentray = [*python, "bentray_service.cli"]
        if part == "workers":
            how = ["--workers", str(self._workers), "--no-opencl", "--memory-limit", "2GiB"]
            scratch = ["--local-directory", str(self._folder / "scratch")]
            return [*bentray, "worker", "--scheduler", self.scheduler_address, *how, *scratch]
        return [*bentray, "serve", "--port", str(self._service_port)]

    def start(self, part: str) -> None:
        """Start a part, as whatever looks after it would."""
        if part != "scheduler":
            self._wait_for_scheduler()
        with (self._folder / f"{part}.log").open("ab") as log:
            self.parts[part] = subprocess.Popen(
                self._command(part), env=self._environment, stdout=log, stderr=log, start_new_session=True
            )

    def _wait_for_scheduler(self) -> None:
        def there() -> bool:
            try:
                socket.create_connection((self.host, self._scheduler_port), 1.0).close()
            except OSError:
                return False
            return True

        wait_until(there)

    def kill(self, part: str) -> None:
        """SIGKILL to a part and to all that it has started."""
        process = self.parts[part]
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def restart(self, part: str) -> None:
        """Kill a part and start it again."""
        self.kill(part)
        self.start(part)

    def worker_pids(self) -> list[int]:
        """The processes that run tasks: those below the one that looks after them."""
        return [pid for pid in below(self.parts["workers"].pid) if b"spawn_main" in command_of(pid)]

    def kill_a_worker(self, which: int = 0) -> None:
        """SIGKILL to one process that runs tasks; the one above it starts another."""
        pids = self.worker_pids()
        if pids:
            os.kill(pids[which % len(pids)], signal.SIGKILL)

    def wait_ready(self) -> None:
        """Wait until the service and its workers answer."""
        wait_until(lambda: self.http.get("/health/ready").is_success)

    def submit(self, dataset: str | None = None, **settings: Any) -> str:
        """Queue a reconstruction, or without a dataset a simulation; its id."""
        kind = {"kind": "simulation"} if dataset is None else {"kind": "reconstruction", "dataset": dataset}
        answer = self.http.post("/v1/jobs", json={**kind, "settings": settings})
        assert answer.status_code == 202, answer.text
        return str(answer.json()["id"])

    def upload(self, path: Path) -> str:
        """Send a dataset; its id."""
        headers = {"Content-Type": "application/x-hdf5"}
        answer = self.http.post("/v1/datasets", content=path.read_bytes(), headers=headers)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    def job(self, job_id: str) -> dict[str, Any]:
        """The record of a job."""
        record: dict[str, Any] = self.http.get(f"/v1/jobs/{job_id}").raise_for_status().json()
        return record

    def ended(self, job_id: str, patience_s: float = PATIENCE_S) -> dict[str, Any]:
        """The record of a job at its end."""

        def record() -> dict[str, Any] | None:
            result = self.job(job_id)
            return result if result["state"] in ENDED else None

        result: dict[str, Any] = wait_until(record, patience_s)
        return result

    def close(self) -> None:
        """End every part; nothing may be left."""
        self.http.close()
        sessions = [process.pid for process in self.parts.values()]
        for process in reversed(list(self.parts.values())):
            process.terminate()
        for process in self.parts.values():
            try:
                process.wait(60.0)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        # What watches a dead process ends after it.
        deadline = time.monotonic() + 60.0
        while left := [pid for session in sessions for pid in of_session(session)]:
            assert time.monotonic() < deadline, [command_of(pid) for pid in left]
            time.sleep(0.1)


def below(pid: int) -> list[int]:
    """The processes that one has started, and theirs."""
    results = []
    for task in Path(f"/proc/{pid}/task").glob("*"):
        for child in (task / "children").read_text().split():
            results += [int(child), *below(int(child))]
    return results


def command_of(pid: int) -> bytes:
    """The command line of a process; nothing where it has gone."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def of_session(session: int) -> list[int]:
    """The processes of a session that are still there, and no zombies."""
    results = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, own = status.read_text().rpartition(") ")[2].split()[:4]
        except OSError:
            continue
        if int(own) == session and state != "Z":
            results.append(int(status.parent.name))
    return results

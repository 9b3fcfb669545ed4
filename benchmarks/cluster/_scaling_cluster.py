"""A local scheduler with worker processes, and the cost of sleeping tasks."""

import os
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.cluster.dask_settings import NO_DASHBOARD, ours
from bentray_workers.cluster.fair_shares import IN_FLIGHT
from bentray_workers.cluster.resources import RECONSTRUCTION, THREADS
from bentray_workers.cluster.task_pool import EndedFutures

from ._scaling_tasks import pause
from ._scaling_work import Work

SETTLE_S = 2.0

QUIET = [f"--dashboard-address={NO_DASHBOARD}", "--no-dashboard"]


@dataclass(frozen=True)
class Run:
    """A run of sleeping tasks on a cluster.

    Attributes:
        workers: processes.
        length: of a task, s.
        tasks: their number; 0 for an idle cluster.
        seconds: by the clock.
        scheduler: CPU time of the scheduler, s.
        driver: CPU time of the submitting process, s.
    """

    workers: int
    length: float
    tasks: int
    seconds: float
    scheduler: float
    driver: float


class Machine:
    """A scheduler, a client, and workers that can be added."""

    def __init__(self, scheduler: psutil.Process, cluster: Cluster, start_worker: object) -> None:
        self._scheduler = scheduler
        self._cluster = cluster
        self._start_worker = start_worker

    def grow_to(self, workers: int) -> None:
        """Start missing workers, and wait until they have joined."""
        for _ in range(workers - self._cluster.describe()["workers"]):
            self._start_worker()  # type: ignore[operator]
        self._cluster.client.wait_for_workers(workers, timeout=120)

    def run(self, work: Work, length: float, tasks: int) -> Run:
        """Run tasks as for slices: a few in flight, with the state sent and returned with each."""
        client, workers = self._cluster.client, self._cluster.describe()["workers"]
        window, left = IN_FLIGHT * workers, deque(range(tasks))
        state = bytes(int(work.sent))
        before, begun = self._spent(), time.perf_counter()
        running, ended = [], EndedFutures()
        while left or running:
            while left and len(running) < window:
                left.popleft()
                asked = (pause, length, state, int(work.returned))
                running.append(ended.watch(client.submit(*asked, resources=RECONSTRUCTION, pure=False)))
            for future in ended.take():
                running.remove(future)
                future.result()
        seconds = time.perf_counter() - begun
        return Run(workers, length, tasks, seconds, *self._spent(before))

    def idle(self, seconds: float) -> Run:
        """Cost of the heartbeats of idle workers."""
        time.sleep(SETTLE_S)
        before = self._spent()
        time.sleep(seconds)
        return Run(self._cluster.describe()["workers"], 0.0, 0, seconds, *self._spent(before))

    def _spent(self, before: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
        times = self._scheduler.cpu_times()
        return times.user + times.system - before[0], time.process_time() - before[1]


@contextmanager
def machine(folder: Path) -> Iterator[Machine]:
    """A scheduler on loopback without workers; all processes end with the context."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    environment = {**os.environ, "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"}
    # Workers import the sleeping task.
    environment["PYTHONPATH"] = os.pathsep.join(
        [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    )
    processes: list[subprocess.Popen[bytes]] = []

    def start(*words: str) -> psutil.Process:
        command = [sys.executable, "-m", "dask", *words, *QUIET]
        with (folder / "log").open("ab") as log:
            processes.append(subprocess.Popen(command, env=environment, cwd=folder, stdout=log, stderr=log))
        return psutil.Process(processes[-1].pid)

    address = f"tcp://127.0.0.1:{port}"
    resources = " ".join(f"{resource}={amount}" for resource, amount in RECONSTRUCTION.items())
    try:
        with ours():
            scheduler = start("scheduler", "--host=127.0.0.1", f"--port={port}")
            with open_cluster(address, connect_timeout_s=60.0) as cluster:
                yield Machine(
                    scheduler,
                    cluster,
                    lambda: start(
                        "worker", address, "--no-nanny", f"--nthreads={THREADS}", f"--resources={resources}"
                    ),
                )
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()

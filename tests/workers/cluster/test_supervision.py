"""Supervision: workers are replaced whatever ended them, also while replacements start."""

import os
import re
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import dask
import psutil
import pytest
from distributed.core import Status

from bentray_workers.cluster import providers, supervision
from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.cluster.supervision import Losses

from ...waiting import wait_until

PATIENCE_S = 60.0


def worker_pids() -> set[int]:
    """The worker processes of this process."""
    listed = set()
    for child in psutil.Process().children():
        try:
            if "spawn_main" in " ".join(child.cmdline()):
                listed.add(child.pid)
        except psutil.Error:
            continue
    return listed


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cluster]:
    """An embedded cluster of one process, which compiles nothing at its start."""
    monkeypatch.setattr(providers, "PRELOAD", None)
    monkeypatch.setattr(supervision, "CHECK_S", 0.1)
    with open_cluster(workers=1, local_directory=tmp_path) as cluster:
        yield cluster


@pytest.mark.nightly
def test_a_worker_killed_while_its_successor_starts_is_replaced(own: Cluster) -> None:
    killed: set[int] = set()
    # Dask gives a nanny up whose worker stays away for this long, 15 s by default.
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "0.2s"}):
        for _ in range(3):
            wait_until(lambda: worker_pids() - killed)
            for pid in worker_pids() - killed:
                os.kill(pid, signal.SIGKILL)
                killed.add(pid)
        wait_until(lambda: own.describe()["workers"] == 0)
        wait_until(lambda: own.describe()["workers"] == 1)
    assert own.client.submit(sum, [1, 2], pure=False).result(timeout=PATIENCE_S) == 3
    assert len(killed) == 3


@pytest.mark.nightly
def test_a_worker_without_its_nanny_is_replaced(own: Cluster) -> None:
    deployed: Any = own.client.cluster
    (nanny,) = deployed.workers.values()
    deployed.sync(nanny.close)
    wait_until(lambda: own.describe()["workers"] == 1)
    assert nanny not in deployed.workers.values()
    assert own.client.submit(sum, [1, 2], pure=False).result(timeout=PATIENCE_S) == 3


@pytest.mark.nightly
def test_workers_that_do_not_start_are_tried_again(
    own: Cluster, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    deployed: Any = own.client.cluster
    monkeypatch.setattr(supervision, "FIRST_PAUSE_S", 0.1)
    spec = deployed.worker_spec[0]
    deployed.worker_spec[0] = {**spec, "options": {**spec["options"], "nthreads": "many"}}
    (nanny,) = deployed.workers.values()
    deployed.sync(nanny.close)
    wait_until(lambda: "no worker could be started" in caplog.text)
    deployed.worker_spec[0] = spec
    wait_until(lambda: own.describe()["workers"] == 1)


def test_a_nanny_without_a_process_is_lost_only_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(supervision, "time", SimpleNamespace(monotonic=lambda: now[0]))
    alive = [False]
    nanny = Mock(status=Status.running, is_alive=lambda: alive[0])
    losses = Losses()
    assert not losses.lost(nanny)
    now[0] = supervision.WITHOUT_PROCESS_S - 1.0
    assert not losses.lost(nanny)
    alive[0] = True
    assert not losses.lost(nanny)
    alive[0], now[0] = False, now[0] + 2.0
    assert not losses.lost(nanny), "its process was there meanwhile"
    now[0] += supervision.WITHOUT_PROCESS_S + 1.0
    assert losses.lost(nanny)
    nanny.status = Status.starting
    assert not losses.lost(nanny)
    nanny.status = Status.closed
    assert losses.lost(nanny)


def blocks_interrupts(pid: int) -> bool:
    """Whether a process is never told of Ctrl-C."""
    (mask,) = re.findall(r"^SigBlk:\s*(\w+)", Path(f"/proc/{pid}/status").read_text(), re.M)
    return bool(int(mask, 16) >> signal.SIGINT - 1 & 1)


def test_a_start_that_compiles_for_long_is_given_up_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "slow.py").write_text("import time\ndef dask_setup(worker):\n    time.sleep(600)\n")
    monkeypatch.setattr(providers, "PRELOAD", str(tmp_path / "slow.py"))
    before = worker_pids()
    with ThreadPoolExecutor(1) as pool:
        started = pool.submit(open_cluster, workers=1, local_directory=tmp_path)
        wait_until(lambda: worker_pids() - before)
        assert all(map(blocks_interrupts, worker_pids() - before))

        def given_up() -> bool:
            supervision.stop_starting()
            return started.done()

        wait_until(given_up)
        with pytest.raises(RuntimeError, match="failed to start"):
            started.result()
    wait_until(lambda: not worker_pids() - before)

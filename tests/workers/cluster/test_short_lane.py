"""The lane of short jobs beside long tasks that hold every worker, and results that leave the workers."""

import gc
import threading
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bentray_kernels.task_graph import POLL_S, Task
from bentray_workers.cluster.capacities import WorkerCapacity
from bentray_workers.cluster.fair_shares import Shares
from bentray_workers.cluster.resources import DRAWING, OFFERED, RECONSTRUCTION, SHORT
from bentray_workers.cluster.short_lane import LEAVES_S, LONG_LANE, SHORT_LANE, is_short
from bentray_workers.cluster.task_pool import run_job

PATIENCE_S = 60.0


MIB = 2**20


WORKER = WorkerCapacity(2048 * MIB, tuple(OFFERED))


PLAN = {"lane": "recon", "largest_bytes": 30 * MIB}


# Released when both long tasks have been seen beside a short job.
BEGUN, LEAVE = threading.Semaphore(0), threading.Event()


def hold() -> None:
    """A task as of a long simulation: no call of it returns before the short job has."""
    BEGUN.release()
    assert LEAVE.wait(PATIENCE_S)


class Graph:
    """So many tasks in a row, or all at a time."""

    def __init__(self, function: Any, tasks: int, *, at_once: bool) -> None:
        self.total, self.done = tasks, 0
        self._tasks = [Task(function) for _ in range(tasks)]
        self._at_once = at_once

    def first(self) -> list[Task]:
        return self._tasks if self._at_once else self._tasks[:1]

    def after(self, task: Task, result: Any) -> list[Task]:
        self.done += 1
        return [] if self._at_once else self._tasks[self.done : self.done + 1]


@pytest.mark.parametrize("lane", [SHORT_LANE, "drawing"])
def test_other_lanes_do_not_wait_for_tasks_that_hold_every_worker(
    cluster: Any, tmp_path: Path, lane: str
) -> None:
    """The first tasks of further long jobs wait on the workers, and must block no other lane there."""
    shares, client, graph = Shares(), cluster.client, Graph(int, 5, at_once=False)
    LEAVE.clear()

    def long_job(number: int) -> None:
        with shares.of("busy", LONG_LANE, client) as share:
            run_job(client, Graph(hold, 2, at_once=True), tmp_path / f"{number}", share=share)

    threads = [threading.Thread(target=long_job, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(2):
            assert BEGUN.acquire(timeout=PATIENCE_S)
        # Two further ones are ready on the workers.
        time.sleep(0.3)
        stop = threading.Timer(5.0, LEAVE.set)
        stop.start()
        with shares.of("small", lane, client) as share:
            placement = {"resources": DRAWING if lane == "drawing" else RECONSTRUCTION}
            run_job(client, graph, tmp_path / "other", lane=lane, placement=lambda: placement, share=share)
        assert graph.done == 5
        assert not LEAVE.is_set(), "it waited for a long task"
        stop.cancel()
    finally:
        LEAVE.set()
        for thread in threads:
            thread.join()


def test_a_job_that_turns_out_long_leaves_the_lane() -> None:
    now = [0.0]
    client: Any = SimpleNamespace(scheduler_info=lambda n_workers: {"workers": {"a": {}, "b": {}}})
    shares = Shares(lambda: now[0])
    recon = {"resources": RECONSTRUCTION}
    with (
        shares.of("a", SHORT_LANE, client) as share,
        shares.of("b", LONG_LANE, client),
        shares.of("a", SHORT_LANE, client) as other,
    ):
        assert share.may_submit(0, 9)
        assert share.placed(recon) == {"resources": SHORT}
        assert share.placed({"resources": {"recon": 1, "opencl": 1}})["resources"]["opencl"] == 1
        now[0] = LEAVES_S + 1.0
        assert share.may_submit(0, 9)
        assert share.placed(recon) == recon
        assert other.placed(recon) == {"resources": SHORT}


@pytest.mark.parametrize(
    ("plan", "seconds", "workers", "short"),
    [
        ({}, 2.0, [WORKER], True),
        ({}, 30.0, [WORKER], False),
        ({}, None, [WORKER], False),
        ({"lane": "opencl"}, 2.0, [WORKER], False),
        ({"lane": "render"}, 2.0, [WORKER], False),
        ({"largest_bytes": 500 * MIB}, 2.0, [WORKER], False),
        ({}, 2.0, [], False),
    ],
)
def test_what_is_short(plan: dict[str, Any], seconds: float | None, workers: list[Any], short: bool) -> None:
    assert is_short({**PLAN, **plan}, seconds, workers) == short


def test_workers_of_an_earlier_version_have_no_such_lane() -> None:
    earlier = WorkerCapacity(2048 * MIB, ("recon", "render"))
    assert not is_short(PLAN, 2.0, [earlier])
    assert is_short(PLAN, 2.0, [earlier, WORKER])
    assert is_short({**PLAN, "largest_bytes": 2**40}, 2.0, [WorkerCapacity(0, tuple(OFFERED))])


def test_no_result_of_a_long_task_stays_on_its_worker(cluster: Any, tmp_path: Path) -> None:
    futures, held = cluster.client.futures, []
    graph = Graph(partial(time.sleep, 1.5 * POLL_S), 5, at_once=False)
    gc.collect()
    gc.disable()
    try:
        run_job(cluster.client, graph, tmp_path, on_saved=lambda: held.append(len(futures)))
    finally:
        gc.enable()
    # Releases are messages: the last one may be on its way.
    assert len(held) == 5
    assert max(held) - held[0] < 2

"""The pool of a job: workers of a cluster that tasks run on, with retries, or threads of this process."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from distributed import Client, Future, wait

from bentray_kernels.task_graph import POLL_S, Pool, Task, TaskGraph, ThreadPool, run
from bentray_kernels.tomography.result import Progress

from .attempts import Attempts
from .fair_shares import Share, alone
from .resources import RECONSTRUCTION

# Where a task may run: keyword arguments ``resources`` and ``workers`` of ``Client.submit``.
Placement = Mapping[str, Any]


class ClusterPool:
    """Workers of a cluster; see ``task_graph.Pool``.

    Args:
        attempts: of the job.
        client: of the cluster.
        share: of the workers.
        priority: above or below the tasks of other jobs.
    """

    def __init__(self, attempts: Attempts, client: Client, share: Share, priority: int = 0) -> None:
        self._attempts, self._client, self._share = attempts, client, share
        self._priority = self._next_priority = priority

    def may_submit(self, running: int, ready: int) -> bool:
        self._next_priority = self._priority + self._share.priority(running)
        return self._share.may_submit(running, ready)

    def submit(self, task: Task) -> Future:
        return self._attempts.submit(task, self._next_priority)

    def finished(self, running: list[Future]) -> list[Future]:
        if not running:
            self._share.wait()
        return finished(self._client, running)

    def result(self, handle: Future) -> tuple[Future | None, Any]:
        return self._attempts.result(handle)

    def cancel(self, running: list[Future]) -> None:
        for future in running:
            future.cancel()
        self._share.pause()


def open_pool(
    client: Client | None,
    folder: Path,
    share: Share | None = None,
    *,
    lane: str = "recon",
    placement: Callable[[], Placement] = lambda: {"resources": RECONSTRUCTION},
    priority: int = 0,
    threads: int | None = None,
) -> Pool:
    """The pool of a job.

    Args:
        client: of a cluster; None: threads of this process.
        folder: of the job, which every worker can write.
        share: of the workers; None: all of them.
        lane: the resource that the share counts.
        placement: where tasks may run; evaluated for each attempt, since workers come and go.
        priority: see ``ClusterPool``.
        threads: without a client; None: one for each core.
    """
    if client is None:
        return ThreadPool(threads)
    attempts = Attempts(client, folder, placement)
    return ClusterPool(attempts, client, share or alone(client, lane), priority)


def run_job(
    graph: TaskGraph,
    pool: Pool,
    on_progress: Callable[[Progress], None] | None = None,
    on_saved: Callable[[], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> None:
    """Run a task graph whose finished tasks leave files, from which a later run resumes.

    Args:
        graph: to run.
        pool: where tasks run.
        on_progress: called at the start and after each task.
        on_saved: called after each task.
        stop: polled several times a second; true raises ``Cancelled``, without waiting for tasks on workers.
    """

    def report() -> None:
        if on_progress is not None:
            on_progress(Progress(graph.done, graph.total))

    def save(_name: str) -> None:
        if on_saved is not None:
            on_saved()
        report()

    report()
    run({"job": graph}, pool, save, stop)


def finished(client: Client, running: list[Future]) -> list[Future]:
    """Those that have ended; waits at most ``POLL_S`` for the first one."""
    # Without a default client ``wait`` must be given one.
    with client.as_current():
        try:
            return list(wait(running, timeout=POLL_S, return_when="FIRST_COMPLETED").done)
        except TimeoutError:
            return []

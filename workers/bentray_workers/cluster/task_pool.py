"""The pool of a job: workers of a cluster that tasks run on, with retries, or threads of this process."""

from collections.abc import Callable, Mapping
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypedDict, Unpack

from distributed import Client, Future

from bentray_kernels.task_graph import POLL_S, Pool, Task, TaskGraph, ThreadPool, run
from bentray_kernels.tomography.result import Progress

from .capacities import capacities_of
from .fair_shares import Share, exclusive_share
from .job_progress import job_progress
from .resources import RECONSTRUCTION
from .task_retries import Attempts

# Where a task may run: keyword arguments ``resources`` and ``workers`` of ``Client.submit``.
Placement = Mapping[str, Any]


class JobControl(TypedDict, total=False):
    """Keyword arguments that every job takes.

    Attributes:
        on_progress: called at the start, after each task and while workers compile; the total is 0 while it
            is unknown.
        on_saved: called after each task.
        stop: polled several times a second; true raises ``Cancelled``, without waiting for tasks on workers.
        share: of the workers; None: all of them.
    """

    on_progress: Callable[[Progress], None] | None
    on_saved: Callable[[], None] | None
    stop: Callable[[], bool] | None
    share: Share | None


class ClusterPool:
    """Workers of a cluster; see ``task_graph.Pool``.

    Args:
        attempts: of the job.
        client: of the cluster.
        share: of the workers.
    """

    def __init__(self, attempts: Attempts, client: Client, share: Share) -> None:
        self._attempts, self._client, self._share = attempts, client, share
        self._next_priority = 0.0
        self._ended = EndedFutures()

    def devices(self) -> int:
        return max(1, sum("opencl" in worker.resources for worker in capacities_of(self._client)))

    def may_submit(self, running: int, ready: int) -> bool:
        self._next_priority = self._share.priority(running)
        return self._share.may_submit(running, ready)

    def submit(self, task: Task) -> Future:
        return self._ended.watch(self._attempts.submit(task, self._next_priority))

    def finished(self, running: list[Future]) -> list[Future]:
        if not running:
            self._share.wait()
            return []
        return self._ended.take()

    def result(self, handle: Future) -> tuple[Future | None, Any]:
        again, result = self._attempts.result(handle)
        return (None if again is None else self._ended.watch(again)), result

    def cancel(self, running: list[Future]) -> None:
        for future in running:
            future.cancel()
        self._attempts.end_spans()
        self._share.pause()


def open_pool(
    client: Client | None,
    folder: Path,
    share: Share | None = None,
    *,
    lane: str = "recon",
    placement: Callable[[], Placement] = lambda: {"resources": RECONSTRUCTION},
    threads: int | None = None,
) -> Pool:
    """The pool of a job.

    Args:
        client: of a cluster; None: threads of this process.
        folder: of the job, which every worker can write.
        share: of the workers; None: all of them.
        lane: the resource that the share counts.
        placement: where tasks may run; evaluated for each attempt, since workers come and go.
        threads: without a client; None: one for each core.
    """
    if client is None:
        return ThreadPool(threads)
    share = share or exclusive_share(client, lane)
    attempts = Attempts(client, folder, lambda: share.placed(placement()))
    return ClusterPool(attempts, client, share)


def run_job(
    client: Client | None,
    graph: TaskGraph,
    folder: Path,
    *,
    lane: str = "recon",
    placement: Callable[[], Placement] = lambda: {"resources": RECONSTRUCTION},
    current: Callable[[], Progress] | None = None,
    **control: Unpack[JobControl],
) -> None:
    """Run a task graph whose finished tasks leave files, from which a later run resumes.

    Args:
        client, folder, lane, placement: see ``open_pool``.
        graph: to run.
        current: the progress now, looked at while tasks run; None: that of the graph.
        control: see ``JobControl``.

    Raises:
        Cancelled: when ``stop`` returned true.
        KilledWorker: for a task that kills its workers.
    """
    now = current or (lambda: Progress(graph.done, graph.total))
    progress, on_saved = job_progress(client, control.get("on_progress"), now), control.get("on_saved")
    pool = open_pool(client, folder, control.get("share"), lane=lane, placement=placement)

    def save(_name: str) -> None:
        if on_saved is not None:
            on_saved()
        progress.report(now())

    progress.report(now())
    run({"job": graph}, pool, save, progress.watching(control.get("stop")))


class EndedFutures:
    """Watched futures that have ended, in the order of their ends.

    Not by ``distributed.wait`` with a time-out, whose error is in a cycle with the frames that refer to the
    futures: until this process collected its garbage, workers kept the results (823 in place of 195 MiB).
    """

    def __init__(self) -> None:
        self._ended: SimpleQueue[Future] = SimpleQueue()

    def watch(self, future: Future) -> Future:
        """Add a future; returns it."""
        future.add_done_callback(self._ended.put)
        return future

    def take(self) -> list[Future]:
        """Those that have ended since the last call; waits at most ``POLL_S`` for the first one."""
        ended: list[Future] = []
        try:
            ended.append(self._ended.get(timeout=POLL_S))
            while True:
                ended.append(self._ended.get_nowait())
        except Empty:
            return ended

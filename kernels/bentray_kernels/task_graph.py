"""Task graphs of pipelines, and the one loop that runs them: submit, poll, cancel, retry, checkpoint."""

import os
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any, NamedTuple, Protocol, runtime_checkable

from threadpoolctl import threadpool_limits

from .opencl.lost_device import with_cpu_retry

# Longest wait for a result before ``stop`` is polled again, s.
POLL_S = 0.2


class Cancelled(Exception):  # noqa: N818 - the word that users and job states have for it
    """Raised after a request to stop; results that are not saved are dropped."""


class Task(NamedTuple):
    """A function call that can run now.

    Attributes:
        keep_on_worker: only other tasks need the result, so it may stay where it was computed;
            ``TaskGraph.after`` then gets a handle, which replaces the value in arguments of later tasks.
        batch_function: runs tasks with the same ``batch_function``: takes a list of their arguments and
            returns a list of their results, which are the same as one by one; None: each task runs by itself.
            For devices, which are faster with many tasks at a time.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    keep_on_worker: bool = False
    batch_function: Callable[[list[tuple[Any, ...]]], list[Any]] | None = None


class TaskGraph(Protocol):
    """The tasks of a pipeline and their order.

    Attributes:
        done, total: finished units of work and their number; ``total`` is 0 while it is unknown.
    """

    @property
    def done(self) -> int: ...
    @property
    def total(self) -> int: ...

    def first(self) -> list[Task]:
        """Tasks to start with, or to continue with after a restart."""

    def after(self, task: Task, result: Any) -> list[Task]:
        """Tasks that can run now that another one has finished.

        Args:
            task: the finished one.
            result: its result, or a handle of it with ``task.keep_on_worker``.
        """


@runtime_checkable
class Checkpoint(Protocol):
    """The state of a task graph: all that is needed to resume it to the same bits."""

    @property
    def state(self) -> Any:
        """State of the iteration in progress; replaced by another object when it changes."""

    @property
    def milestone(self) -> tuple[Any, ...]:
        """A value that changes when an iteration, a stage or a final result is finished."""


class ResumableGraph(TaskGraph, Protocol):
    """A task graph whose state is held in memory and can be saved."""

    @property
    def checkpoint(self) -> Checkpoint: ...

    def restore(self, checkpoint: Any) -> None:
        """Resume from a checkpoint of the same graph; to be called before ``first``."""


class CheckpointStore(Protocol):
    """Where the loop saves the states of graphs."""

    def save(self, name: str, checkpoint: Checkpoint) -> None: ...
    def load(self, name: str) -> Checkpoint | None: ...


class Pool(Protocol):
    """Where tasks run: threads of this process, or workers of a cluster."""

    def devices(self) -> int:
        """Over how many calls tasks with ``batch_function`` are distributed, at least 1."""

    def may_submit(self, running: int, ready: int) -> bool:
        """Whether to submit another task.

        Args:
            running: tasks submitted and not yet finished.
            ready: tasks that could be submitted.
        """

    def submit(self, task: Task) -> Any:
        """Start a task; returns its handle."""

    def finished(self, running: list[Any]) -> list[Any]:
        """Handles of finished tasks; waits at most ``POLL_S`` for the first one."""

    def result(self, handle: Any) -> tuple[Any | None, Any]:
        """The handle of a new attempt of a finished task, or None and its result."""

    def cancel(self, running: list[Any]) -> None:
        """Drop tasks whose results are not needed any more; called once at the end of a run."""


def run(
    graphs: Mapping[str, TaskGraph],
    pool: Pool,
    on_result: Callable[[str], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> None:
    """Run task graphs to their end.

    Args:
        graphs: by name; tasks that follow a result go before the first tasks of further graphs, so that
            memory held by an iteration is freed early.
        pool: where tasks run. The results do not depend on it.
        on_result: called with the name of a graph after each of its results.
        stop: polled several times a second; true raises ``Cancelled``.

    Raises:
        Cancelled: when ``stop`` returned true.
    """
    ready = deque((name, task) for name, graph in graphs.items() for task in graph.first())
    running: dict[Any, list[tuple[str, Task]]] = {}
    try:
        while ready or running:
            while pool.may_submit(len(running), len(ready)):
                group = _next_group(ready, pool)
                running[pool.submit(_batched_task(group))] = group
            finished = pool.finished(list(running))
            while finished:
                handle = finished.pop(0)
                group = running.pop(handle)
                retry, result = pool.result(handle)
                # While anything refers to a result, a cluster computes it again if its worker dies.
                del handle
                if retry is not None:
                    running[retry] = group
                    continue
                results = [result] if group[0][1].batch_function is None else result
                del result
                for name, task in group:
                    following = graphs[name].after(task, results.pop(0))
                    ready.extendleft((name, next_task) for next_task in reversed(following))
                    if on_result is not None:
                        on_result(name)
            if stop is not None and stop():
                raise Cancelled
    finally:
        pool.cancel(list(running))


def _next_group(ready: deque[tuple[str, Task]], pool: Pool) -> list[tuple[str, Task]]:
    """The next task, and those that run together with it; they are no longer ready."""
    first = ready.popleft()
    if first[1].batch_function is None:
        return [first]
    same = [first, *(entry for entry in ready if entry[1].batch_function is first[1].batch_function)]
    group = same[: -(-len(same) // pool.devices())]
    # By identity: arrays among arguments have no truth value.
    taken = {id(entry) for entry in group}
    left = [entry for entry in ready if id(entry) not in taken]
    ready.clear()
    ready.extend(left)
    return group


def _batched_task(group: list[tuple[str, Task]]) -> Task:
    """One task that runs a group of tasks."""
    first = group[0][1]
    return (
        first
        if first.batch_function is None
        else Task(first.batch_function, ([task.arguments for _, task in group],))
    )


def run_resumable(
    graphs: Mapping[str, ResumableGraph],
    pool: Pool,
    checkpoints: CheckpointStore,
    on_result: Callable[[], None],
    stop: Callable[[], bool] | None = None,
) -> None:
    """Run graphs whose states are saved after each result and restored before the first task.

    ``on_result`` is called at the start too, unless all graphs are restored as finished.
    """
    for name, graph in graphs.items():
        checkpoint = checkpoints.load(name)
        if checkpoint is not None:
            graph.restore(checkpoint)

    def save(name: str) -> None:
        checkpoints.save(name, graphs[name].checkpoint)
        on_result()

    if any(graph.done < graph.total for graph in graphs.values()):
        on_result()
    run(graphs, pool, save, stop)


class ThreadPool:
    """Threads of this process; compiled kernels release the GIL.

    Args:
        threads: how many; None: one for each core.
    """

    def __init__(self, threads: int | None = 1) -> None:
        self._threads = threads or len(os.sched_getaffinity(0))
        self._executor = ThreadPoolExecutor(self._threads)
        # Otherwise the threads of matrix products compete with these: a full waveform took half as long
        # again. Workers of a cluster have the limit in their environment.
        self._limit = threadpool_limits(1, "blas")

    def devices(self) -> int:
        return 1

    def may_submit(self, running: int, ready: int) -> bool:
        return ready > 0 and running < self._threads

    def submit(self, task: Task) -> Future[Any]:
        return self._executor.submit(with_cpu_retry, task.function, *task.arguments)

    def finished(self, running: list[Future[Any]]) -> list[Future[Any]]:
        # In the order of submission: so one thread's run is the same each time.
        done = wait(running, timeout=POLL_S, return_when=FIRST_COMPLETED).done
        return [future for future in running if future in done]

    def result(self, handle: Future[Any]) -> tuple[None, Any]:
        return None, handle.result()

    def cancel(self, running: list[Future[Any]]) -> None:
        for future in running:
            future.cancel()
        wait(running)
        self._limit.restore_original_limits()

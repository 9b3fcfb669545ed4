"""Retries of tasks of lost workers: submitted again when a worker dies, unless they kill their workers."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from distributed import Client, Future, KilledWorker
from opentelemetry import trace

from bentray_kernels.opencl import with_cpu_retry
from bentray_kernels.task_graph import Task

from .background import in_background
from .memory_cache import evict_for_job
from .resources import DRAWING, RECONSTRUCTION, SHORT

# Deaths of workers while a task runs, after which it fails.
MAX_DEATHS = 2
# Does nothing where the process has no OpenTelemetry provider.
TRACER = trace.get_tracer("bentray")


class ResultsLostError(ConnectionError):
    """Results that a task needs are lost with their workers; the job resumes from its checkpoint."""


class _Attempt(NamedTuple):
    task: Task
    priority: float
    marker: Path
    span: trace.Span
    deaths: int = 0


class Attempts:
    """Tasks of one job on a cluster.

    Dask blames every task of a dead worker, also those that only waited there. So a task leaves a file where
    it runs, which remains when its process is killed and shows which task was running.

    Args:
        client: of the cluster.
        folder: for these files; every worker can write there. It is created if missing.
        placement: where tasks may run; see ``task_pool.open_pool``.
    """

    def __init__(
        self,
        client: Client,
        folder: Path,
        placement: Callable[[], Mapping[str, Any]] = lambda: {"resources": RECONSTRUCTION},
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._client = client
        self._placement = placement
        self._markers = (folder / f"task-{number}" for number in count())
        self._attempts: dict[Future, _Attempt] = {}

    def submit(self, task: Task, priority: float = 0.0) -> Future:
        """Submit a task; when its future has ended it is to be passed to ``result``.

        Args:
            task: to run.
            priority: higher ones first, where tasks wait for the same worker.
        """
        # From here to its result, retries included; below the span of the job.
        name = getattr(task.function, "__name__", type(task.function).__name__)
        span = TRACER.start_span(f"task {name}")
        return self._submit(_Attempt(task, priority, next(self._markers), span))

    def result(self, future: Future) -> tuple[Future | None, Any]:
        """The result of a task; or a new attempt, where its worker died and it may not be the cause.

        A result may be lost with its worker after it was computed. Dask then computes it again, and may blame
        it for the next death.

        Args:
            future: of a task that has ended.

        Returns:
            The future of the new attempt, or None and the result: the future itself with
            ``task.keep_on_worker``.

        Raises:
            KilledWorker: for a task that kills its workers.
            ResultsLostError: where needed results were lost with their workers and not computed again.
        """
        attempt = self._attempts.pop(future)
        again = False
        try:
            kept = attempt.task.keep_on_worker and future.status == "finished"
            return None, future if kept else future.result()
        except KilledWorker as error:
            deaths = attempt.deaths + attempt.marker.exists()
            attempt.marker.unlink(missing_ok=True)
            if deaths > MAX_DEATHS:
                raise
            if any(needed.status == "error" for needed in _futures(attempt.task.arguments)):
                raise ResultsLostError("results that a task needs were lost with their workers") from error
            again = True
            attempt.span.add_event("its worker died")
            return self._submit(attempt._replace(deaths=deaths)), None
        finally:
            if not again:
                attempt.span.set_attribute("dask.status", future.status)
                attempt.span.end()

    def end_spans(self) -> None:
        """End the spans of tasks whose results are not needed any more."""
        for attempt in self._attempts.values():
            attempt.span.end()

    def _submit(self, attempt: _Attempt) -> Future:
        placement = self._placement()
        # Cached scenes are what tasks that draw work with; other tasks are planned for an empty cache.
        evict = not DRAWING.keys() & placement["resources"].keys()
        where = () if SHORT.keys() & placement["resources"].keys() else (in_background,)
        work = attempt.marker, evict, *where, attempt.task.function, *attempt.task.arguments
        future = self._client.submit(marked, *work, **placement, priority=attempt.priority, pure=False)
        self._attempts[future] = attempt
        return future


def _futures(arguments: Iterable[Any]) -> Iterator[Future]:
    """Those among arguments, and in lists among them."""
    for argument in arguments:
        if isinstance(argument, Future):
            yield argument
        elif isinstance(argument, list):
            yield from _futures(argument)


def marked(marker: Path, evict: bool, function: Callable[..., Any], *arguments: Any) -> Any:
    """Task: run a function, on the CPU if a device is lost, with a file that exists as long as it runs."""
    if evict:
        evict_for_job()
    marker.touch()
    try:
        return with_cpu_retry(function, *arguments)
    finally:
        marker.unlink(missing_ok=True)

"""Peak memory of each task of a job in a worker process of its own, beside its plan."""

import ctypes
import gc
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from bentray_workers.cluster import task_retries
from bentray_workers.cluster.background import in_background
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.cluster.task_costs import TaskSize
from bentray_workers.rendering.picture_cost import Cost

from ..reconstruction._worker_use import forget_peak, of_worker, peak_bytes
from ._measured_tasks import Job


class Measured(NamedTuple):
    """A task that was measured.

    Attributes:
        plan: of its memory.
        peak_bytes: beyond the idle worker, the most of all tasks of this name.
    """

    plan: TaskSize | Cost
    peak_bytes: int


def measured(folder: Path, *jobs: Job) -> Iterator[dict[str, Measured]]:
    """Run jobs of one kind in a worker that has run a small one, which loads libraries and compiled code.

    Freed memory is returned to the system before tasks of another name, so that a task is not charged with
    what the one before left.

    Yields:
        For each job by the name of the task; of a picture the whole job.
    """
    with open_cluster(workers=1, local_directory=folder) as cluster:
        client = cluster.client
        of_worker(client, _record_tasks)
        for number, warm in enumerate(jobs[0].warm):
            (small := folder / f"warm-{number}").mkdir()
            warm(client, small)
        for number, job in enumerate(jobs):
            (own := folder / str(number)).mkdir()
            idle = of_worker(client, _begin)
            plan = job.run(client, own)
            peaks = of_worker(client, _end)
            whole = peaks.pop(WHOLE)
            # Tasks without a plan of their own, as those that judge candidates, run within that of others.
            peaks = {name: peak for name, peak in peaks.items() if name in plan}
            largest = max(peaks or plan, key=lambda name: peaks[name] if peaks else plan[name].bytes)
            peaks[largest] = max(whole, peaks.get(largest, 0))
            yield {name: Measured(plan[name], peak - idle) for name, peak in peaks.items()}


# Key of the peak of all that runs in a worker.
WHOLE = ""

# Of this process.
_peaks: dict[str, int] = {}
_last = WHOLE
_call: Callable[..., Any] = task_retries.with_cpu_retry
_LIBC = ctypes.CDLL(None)


def _record_tasks() -> None:
    """On the worker: record each task of a job from now on."""
    task_retries.with_cpu_retry = _recorded


def _recorded(function: Callable[..., Any], *arguments: Any) -> Any:
    global _last
    name = (arguments[0] if function is in_background else function).__name__
    _note(WHOLE)
    if name != _last:
        _LIBC.malloc_trim(0)
        forget_peak()
    _last = name
    try:
        return _call(function, *arguments)
    finally:
        _note(WHOLE)
        _note(name)
        forget_peak()


def _note(name: str) -> None:
    _peaks[name] = max(peak_bytes(), _peaks.get(name, 0))


def _begin() -> int:
    """On the worker: forget recorded peaks and cached values of other jobs; bytes of the idle process."""
    global _last
    for cached in gc.get_objects():
        if isinstance(cached, type(lru_cache(_note))) and cached.__module__.startswith("bentray"):
            cached.cache_clear()
    _peaks.clear()
    _last = WHOLE
    gc.collect()
    _LIBC.malloc_trim(0)
    forget_peak()
    return peak_bytes()


def _end() -> dict[str, int]:
    """On the worker: peaks, bytes, by the name of the task; ``WHOLE`` for the process."""
    _note(WHOLE)
    return _peaks

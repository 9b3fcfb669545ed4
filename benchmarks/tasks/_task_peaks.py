"""Peak memory and CPU time of tasks, in a worker process as the service has, or in a fork."""

from __future__ import annotations

import ctypes
import gc
import os
import pickle
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple
from unittest import mock

from distributed import Client

from bentray_workers.cluster import memory_cache, task_retries
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.compilation import warmup

from ..shared._worker_use import cpu_seconds, forget_peak, peak_bytes


class Peak(NamedTuple):
    """What the tasks of one name took at most, bytes above the idle worker; and all together, CPU seconds."""

    bytes: int
    seconds: float


@contextmanager
def metered_worker(folder: Path) -> Iterator[Client]:
    """A client of a new worker process, whose tasks are metered.

    Args:
        folder: for what the worker stores.
    """
    with (
        open_cluster(workers=1, local_directory=folder) as cluster,
        mock.patch.object(task_retries, "marked", _metered),
    ):
        yield cluster.client


def measured(client: Client, work: Callable[..., Any], *arguments: Any) -> tuple[Any, dict[str, Peak]]:
    """The result of ``work(client, *arguments)``, and the peaks of its tasks by their names."""
    client.run(_clean)
    result = work(client, *arguments)
    (peaks,) = client.run(_found).values()
    return result, {name: Peak(*peak) for name, peak in peaks.items()}


def set_idle(client: Client | None) -> None:
    """Let peaks be measured above the present memory of the worker, or of this fork."""
    if client is None:
        _set_idle()
    else:
        client.run(_set_idle)


def measured_in_fork(work: Callable[..., Any], *arguments: Any) -> tuple[Any, dict[str, Peak]]:
    """As ``measured``, for tasks that are called in a fork of this process; ``work`` gets None as client.

    The process has loaded the compiled code that a worker has loaded, but no library of a file format.

    Raises:
        ChildProcessError: when ``work`` fails; its traceback is on standard error.
    """
    _load_compiled_code()
    reader, writer = os.pipe()
    process = os.fork()
    if process == 0:
        # Leave at once: what the parent registered for its own end is none of the fork's business.
        try:
            found = pickle.dumps((work(None, *arguments), _Meter.peaks))
            with os.fdopen(writer, "wb") as pipe:
                pipe.write(found)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        content = pipe.read()
    os.waitpid(process, 0)
    if not content:
        raise ChildProcessError(f"{work} of {arguments} failed")
    result, peaks = pickle.loads(content)
    return result, peaks


@cache
def _load_compiled_code() -> None:
    warmup.warm_up_rendering()
    warmup.warm_up_tracing()


def call(client: Client | None, function: Callable[..., Any], *arguments: Any, **options: Any) -> None:
    """Call a function as a task, on the worker or in this fork, and drop the result there."""
    if client is not None:
        client.submit(_dropped, function, arguments, options, pure=False).result()
        return
    if not _Meter.idle:
        _set_idle()
    _dropped(function, arguments, options)


class _Meter:
    """State of the worker: the memory when it was idle, and what tasks took since."""

    idle, used = 0, 0.0
    peaks: ClassVar[dict[str, Peak]] = {}


def _clean() -> None:
    """Empty what earlier jobs have cached and freed."""
    kept = type(lru_cache(_clean))
    for value in gc.get_objects():
        if isinstance(value, kept) and value is not _load_compiled_code:
            value.cache_clear()
    memory_cache.evict_to(0)
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    forget_peak()
    _Meter.used, _Meter.peaks = cpu_seconds(), {}


def _set_idle() -> None:
    peaks = _Meter.peaks
    _clean()
    _Meter.idle, _Meter.peaks = peak_bytes(), peaks


def _found() -> dict[str, Peak]:
    return _Meter.peaks


def _metered(marker: Path, evict: bool, function: Callable[..., Any], *arguments: Any) -> Any:
    result = task_retries.marked(marker, evict, function, *arguments)
    _record(function.__name__)
    return result


def _dropped(function: Callable[..., Any], arguments: tuple[Any, ...], options: dict[str, Any]) -> None:
    function(*arguments, **options)
    _record(function.__name__)


def _record(name: str) -> None:
    """What a task took, with the messages before it: the largest memory since the end of the last one."""
    used = cpu_seconds()
    known = _Meter.peaks.get(name, Peak(0, 0.0))
    taken = max(known.bytes, peak_bytes() - _Meter.idle)
    _Meter.peaks[name] = Peak(taken, known.seconds + used - _Meter.used)
    _Meter.used = used
    forget_peak()

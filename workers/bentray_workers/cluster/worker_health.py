"""Health of the connected workers: memory, threads, load and devices, without addresses or names of tasks."""

from dataclasses import dataclass
from typing import Any

from distributed import Client

from bentray_kernels.compilation.compile_events import Compilation

from .connected import connected_workers

# Metric of workers: the fields of ``Compilation``.
COMPILING = "compiling"


@dataclass(frozen=True)
class WorkerHealth:
    """State of one worker at its last heartbeat.

    Attributes:
        threads: that run tasks; None if unknown.
        memory_bytes: resident memory of its process; None before its first heartbeat.
        memory_limit_bytes: Dask pauses the worker near it; 0: no limit.
        cpu_percent: of one processor core; None before its first heartbeat.
        running_tasks: tasks of all tenants that it runs now.
        paused: whether it accepts no tasks, because its memory is nearly used up.
        opencl: whether an OpenCL device of it passed the self-test.
        compiling: whether it compiles kernels; see ``compilation.preload``.
    """

    threads: int | None
    memory_bytes: int | None
    memory_limit_bytes: int
    cpu_percent: float | None
    running_tasks: int
    paused: bool
    opencl: bool
    compiling: bool


def health_of(client: Client) -> tuple[WorkerHealth, ...]:
    """The health of every connected worker, in the order of their addresses.

    Raises:
        ConnectionError: when the scheduler is not available.
    """
    workers = connected_workers(client)
    return tuple(_health(workers[address]) for address in sorted(workers))


def _health(worker: dict[str, Any]) -> WorkerHealth:
    metrics = worker.get("metrics", {})
    memory, cpu, threads = metrics.get("memory"), metrics.get("cpu"), worker.get("nthreads")
    return WorkerHealth(
        threads=None if threads is None else int(threads),
        memory_bytes=None if memory is None else int(memory),
        memory_limit_bytes=int(worker.get("memory_limit") or 0),
        cpu_percent=None if cpu is None else float(cpu),
        running_tasks=int(metrics.get("task_counts", {}).get("executing", 0)),
        paused=worker.get("status") == "paused",
        opencl=worker.get("resources", {}).get("opencl", 0) > 0,
        compiling=compilation_of(worker).active,
    )


def compilation_of(worker: dict[str, Any]) -> Compilation:
    """The kernels that a worker compiles, by the record of the scheduler about it."""
    return Compilation(*worker.get("metrics", {}).get(COMPILING, ()))

"""Cancellation of the Dask task that runs in this thread, checked by long kernels."""

from collections.abc import Callable
from contextvars import ContextVar

from distributed import get_worker

# The check of a task that continues in another thread.
_CARRIED: ContextVar[Callable[[], None] | None] = ContextVar("cancellation check", default=None)


class TaskCancelled(Exception):  # noqa: N818 - names a state, as ``task_graph.Cancelled``
    """The client has released or cancelled the task."""


def cancellation_check() -> Callable[[], None]:
    """A check for the task of this thread, which may be called from any thread.

    The check raises ``TaskCancelled`` once the task is cancelled; outside of a Dask worker it never does. It
    reads the record of the worker, not of the scheduler, and takes less than a microsecond.
    """
    if carried := _CARRIED.get():
        return carried
    try:
        worker = get_worker()
        key = worker.get_current_task()
    except (ValueError, KeyError):
        return lambda: None

    def check() -> None:
        task = worker.state.tasks.get(key)
        if task is None or task.state == "cancelled":
            raise TaskCancelled(key)

    return check


def carry_cancellation() -> None:
    """Let ``cancellation_check`` of this context return the check of the task of this thread."""
    _CARRIED.set(cancellation_check())

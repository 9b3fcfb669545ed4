"""Whether anybody still waits for the Dask task that runs here: long kernels look now and then."""

from __future__ import annotations

from collections.abc import Callable

from distributed import get_worker


class Abandoned(Exception):  # noqa: N818 - names a state, as ``cluster.task_loop.Cancelled``
    """Nobody waits for the result any more: the client has released or cancelled it."""


def look_out() -> Callable[[], None]:
    """Called in the thread of a task: what to call from any thread, as often as one likes.

    It raises ``Abandoned`` once nobody waits for the task; outside of a Dask worker it never does. It asks
    the worker's own record of the task, not the scheduler, and takes less than a microsecond.
    """
    try:
        worker = get_worker()
        key = worker.get_current_task()
    except (ValueError, KeyError):
        return lambda: None

    def check() -> None:
        task = worker.state.tasks.get(key)
        if task is None or task.state == "cancelled":
            raise Abandoned(key)

    return check

"""Load of the scheduler: its tasks and its memory."""

from dataclasses import dataclass
from typing import Any

from distributed import Client
from distributed.protocol.pickle import dumps, loads

# Time in which the scheduler must answer, s.
WITHIN_S = 3.0


@dataclass(frozen=True)
class SchedulerLoad:
    """State of the scheduler now.

    Attributes:
        tasks: that it holds, of all clients.
        waiting_tasks: among these, tasks that no worker can run at present.
        memory_bytes: resident memory of its process.
    """

    tasks: int
    waiting_tasks: int
    memory_bytes: int


def load_of(client: Client) -> SchedulerLoad:
    """The load of the scheduler of a client.

    Raises:
        TimeoutError, OSError: when it does not answer.
    """
    # As ``Client.run_on_scheduler``, which waits for ever.
    answer = client.sync(client.scheduler.run_function, function=dumps(_load), callback_timeout=WITHIN_S)
    if answer["status"] != "OK":
        raise ConnectionError(f"the scheduler could not measure its load: {loads(answer['exception'])}")
    return SchedulerLoad(**answer["result"])


def _load(dask_scheduler: Any) -> dict[str, int]:
    return {
        "tasks": len(dask_scheduler.tasks),
        "waiting_tasks": len(dask_scheduler.unrunnable) + len(dask_scheduler.queued),
        "memory_bytes": dask_scheduler.proc.memory_info().rss,
    }

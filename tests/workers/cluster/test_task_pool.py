"""The pool of a job: results leave the workers when they are used, without the garbage collector."""

import gc
import time
from pathlib import Path
from typing import Any

from bentray_kernels.task_graph import POLL_S, Task
from bentray_workers.cluster.task_pool import run_job


def test_no_result_of_a_long_task_stays_on_its_worker(cluster: Any, tmp_path: Path) -> None:
    held: list[int] = []

    class Row:
        """Five tasks in a row, each longer than a time-out of the loop."""

        total = 5

        @property
        def done(self) -> int:
            return len(held)

        def first(self) -> list[Task]:
            return [Task(time.sleep, (1.5 * POLL_S,))]

        def after(self, task: Task, result: Any) -> list[Task]:
            held.append(len(cluster.client.futures))
            return self.first() if self.done < self.total else []

    gc.collect()
    gc.disable()
    try:
        run_job(cluster.client, Row(), tmp_path)
    finally:
        gc.enable()
    # Releases are messages: the last one may be on its way.
    assert max(held) - held[0] < 2

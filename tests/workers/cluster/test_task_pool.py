"""The pool of a job: results leave the workers when they are used, without the garbage collector."""

import gc
import time
from functools import partial
from pathlib import Path
from typing import Any

from tests.workers.cluster.test_short_lane import Graph

from bentray_kernels.task_graph import POLL_S
from bentray_workers.cluster.task_pool import run_job


def test_no_result_of_a_long_task_stays_on_its_worker(cluster: Any, tmp_path: Path) -> None:
    futures, held = cluster.client.futures, []
    graph = Graph(partial(time.sleep, 1.5 * POLL_S), 5, at_once=False)
    gc.collect()
    gc.disable()
    try:
        run_job(cluster.client, graph, tmp_path, on_saved=lambda: held.append(len(futures)))
    finally:
        gc.enable()
    # Releases are messages: the last one may be on its way.
    assert len(held) == 5
    assert max(held) - held[0] < 2

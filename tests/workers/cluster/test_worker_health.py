"""Health of workers: memory, threads and load of each, without addresses."""

from dataclasses import asdict

import pytest

from bentray_workers.cluster.scheduler_load import load_of
from bentray_workers.cluster.worker_health import health_of

from ...waiting import wait_until


class Scheduler:
    """A client that knows these workers."""

    def __init__(self, record):
        self._record = record

    def scheduler_info(self, n_workers):
        assert n_workers == -1
        return self._record


def of(**workers):
    return health_of(Scheduler({"workers": workers}))


def test_embedded_workers_report_themselves(cluster):
    workers = health_of(cluster.client)
    assert len(workers) == 2
    assert all(one.threads >= 1 and one.memory_bytes > 0 and not one.paused for one in workers)


def test_the_scheduler_reports_its_load(cluster):
    future = cluster.client.submit(abs, -1, resources={"no such resource": 1})
    load = wait_until(lambda: (load := load_of(cluster.client)).waiting_tasks == 1 and load, 120.0)
    assert load.tasks >= 1
    assert load.memory_bytes > 1e6
    future.cancel()


def test_a_worker_in_full():
    metrics = {"memory": 5, "cpu": 180.0, "task_counts": {"executing": 2, "ready": 7}}
    metrics["compiling"] = [3, 8, True]
    worker = {"nthreads": 2, "memory_limit": 9, "resources": {"opencl": 1.0}, "metrics": metrics}
    (first,) = of(here={**worker, "status": "paused"})
    assert asdict(first) == {
        "threads": 2,
        "memory_bytes": 5,
        "memory_limit_bytes": 9,
        "cpu_percent": 180.0,
        "running_tasks": 2,
        "paused": True,
        "opencl": True,
        "compiling": True,
    }


def test_a_worker_before_its_first_heartbeat():
    (one,) = of(here={"resources": {"opencl": 0}})
    assert (one.threads, one.memory_bytes, one.memory_limit_bytes, one.cpu_percent) == (None, None, 0, None)
    assert (one.running_tasks, one.paused, one.opencl, one.compiling) == (0, False, False, False)


def test_the_order_is_that_of_the_addresses():
    assert [worker.threads for worker in of(b={"nthreads": 2}, a={"nthreads": 1})] == [1, 2]


def test_without_a_scheduler():
    with pytest.raises(ConnectionError, match="not available"):
        health_of(Scheduler({}))

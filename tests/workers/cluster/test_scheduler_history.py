"""Scheduler, streams and workers keep no state of finished tasks."""

import gc
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from distributed.batched import BatchedSend
from distributed.scheduler import TaskGroup

from bentray_workers.cluster.connection import Cluster, open_cluster

from ...waiting import wait_until

TASKS = 20
# Of an array that each task is given.
VALUES = 10_000


@pytest.fixture
def cluster() -> Iterator[Cluster]:
    """One with everything in this process."""
    with open_cluster(workers=1, processes=False) as made:
        yield made


def run_tasks(cluster: Cluster) -> None:
    """One after the other, each forgotten before the next."""
    deployed: Any = cluster._deployed
    for number in range(TASKS):
        assert cluster.client.submit(np.sum, np.full(VALUES, number), pure=False).result() == VALUES * number
        wait_until(lambda: not deployed.scheduler.tasks, pause_s=0.005)


def alive(kind: type[Any]) -> list[Any]:
    """The objects of a class that something refers to."""
    gc.collect()
    return [item for item in gc.get_objects() if type(item) is kind]


def test_no_group_of_tasks_is_kept(cluster: Cluster) -> None:
    # Other tests of this process may have clusters of their own.
    before = {id(left) for left in alive(TaskGroup)}
    run_tasks(cluster)
    # The event loop may still handle the last message. A list of the groups themselves would keep them.
    wait_until(lambda: all(id(left) in before for left in alive(TaskGroup)))


def test_no_message_is_kept(cluster: Cluster) -> None:
    run_tasks(cluster)
    streams = [stream for stream in alive(BatchedSend) if stream.message_count]
    # Of the client, of the worker, and of the scheduler to each of them.
    assert len(streams) >= 3
    assert [len(stream.recent_message_log) for stream in streams] == [0] * len(streams)


def test_a_worker_keeps_no_times_of_single_tasks(cluster: Cluster) -> None:
    deployed: Any = cluster._deployed
    (worker,) = deployed.workers.values()
    run_tasks(cluster)
    before = set(worker.digests_total)
    run_tasks(cluster)
    assert set(worker.digests_total) == before

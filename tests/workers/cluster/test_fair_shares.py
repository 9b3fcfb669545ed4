"""Shares: a tenant alone has all workers, several have equal parts, and a small job is not held up."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest

from bentray_workers.cluster.fair_shares import IN_FLIGHT, TURN_S, Shares


@dataclass
class Job:
    """A job of so many tasks of equal length, of which ``wide`` can begin at a time."""

    tenant: str
    tasks: int
    task_s: float
    wide: int = 10**6
    begins_s: float = 0.0
    ended_s: float | None = None
    worked_s: float = 0.0
    in_flight: int = 0
    begun: int = 0
    share: Any = field(default=None, repr=False)

    @property
    def ready(self) -> int:
        return max(0, min(self.tasks - self.begun, self.wide - self.in_flight))


def run(workers: int, jobs: Sequence[Job], until_s: float = 1e4) -> None:
    """Drive jobs on a cluster of which each worker takes its queued tasks by priority, as Dask does."""
    now = [0.0]
    shares, number = Shares(lambda: now[0]), count()
    client: Any = SimpleNamespace(
        scheduler_info=lambda n_workers: {"workers": {str(k): {} for k in range(workers)}}
    )
    queues: list[list[tuple[float, int, Job]]] = [[] for _ in range(workers)]
    busy: list[tuple[float, int, Job] | None] = [None] * workers
    joined: dict[int, Any] = {}

    def drive(job: Job) -> None:
        while job.share.may_submit(job.in_flight, job.ready):
            queue = min(range(workers), key=lambda w: len(queues[w]) + (busy[w] is not None))
            heapq.heappush(queues[queue], (-job.share.priority(job.in_flight), next(number), job))
            job.in_flight += 1
            job.begun += 1

    while now[0] < until_s and any(job.ended_s is None for job in jobs):
        for job in jobs:
            if job.share is None and job.begins_s <= now[0]:
                joined[id(job)] = shares.of(job.tenant, "recon", client)
                job.share = joined[id(job)].__enter__()
            # Who waits looks now and then; who has something in flight looks when it ends.
            if job.share is not None and job.ended_s is None and not job.in_flight:
                drive(job)
        for w in range(workers):
            if busy[w] is None and queues[w]:
                _, _, job = heapq.heappop(queues[w])
                busy[w] = now[0] + job.task_s, w, job
        ends = [one for one in busy if one is not None]
        later = [now[0] + TURN_S, *(end[0] for end in ends), *(j.begins_s for j in jobs if j.share is None)]
        now[0] = min(time for time in later if time >= now[0])
        for end, w, job in sorted(ends, key=lambda one: one[:2]):
            if end <= now[0]:
                busy[w] = None
                job.in_flight -= 1
                job.worked_s += job.task_s
                if job.begun == job.tasks and not job.in_flight:
                    job.ended_s = now[0]
                    joined.pop(id(job)).__exit__(None, None, None)
                else:
                    drive(job)


def test_a_tenant_alone_has_every_worker_with_one_task_ready_for_each() -> None:
    shares = Shares()
    client: Any = SimpleNamespace(scheduler_info=lambda n_workers: {"workers": {"a": {}, "b": {}}})
    with shares.of("a", "recon", client) as share:
        begun = 0
        while share.may_submit(begun, 100):
            begun += 1
        assert begun == IN_FLIGHT * 2
        with shares.of("b", "render", client) as other:
            assert not share.may_submit(begun, 100)
            assert share.may_submit(begun - 1, 100), "another lane is no rival"
            assert not other.may_submit(0, 0)


@pytest.mark.parametrize("workers", [1, 2, 3, 8])
@pytest.mark.parametrize("large", [1, 2, 5])
def test_small_job_runs_during_long_jobs(workers: int, large: int) -> None:
    """Twenty tasks of 50 ms one after the other, beside tasks of 5 s in any number."""
    hours = [Job("busy", 10**6, 5.0) for _ in range(large)]
    small = Job("new", 20, 0.05, wide=1, begins_s=31.0)
    run(workers, [*hours, small], until_s=120.0)
    assert small.ended_s is not None
    # What is at work when it comes; with a single worker what was ready there too; and its own second.
    assert small.ended_s - small.begins_s <= 5.0 * (2 if workers == 1 else 1) + 1.0 + 2 * TURN_S


@pytest.mark.parametrize("workers", [1, 2, 3, 8])
def test_many_small_jobs_of_as_many_tenants(workers: int) -> None:
    hours = [Job("busy", 10**6, 5.0), Job("busy", 10**6, 5.0)]
    small = [Job(f"tenant-{k}", 20, 0.05, wide=1, begins_s=31.0) for k in range(6)]
    run(workers, [*hours, *small], until_s=200.0)
    for job in small:
        assert job.ended_s is not None
        assert job.ended_s - job.begins_s <= 5.0 + 6 * 1.0 + 6.0


@pytest.mark.parametrize("workers", [1, 2, 3, 8])
def test_tenants_get_equal_time_whatever_their_number_of_jobs_and_length_of_tasks(workers: int) -> None:
    many = [Job("many", 10**6, 0.5) for _ in range(4)]
    alone = Job("one", 10**6, 2.0)
    run(workers, [*many, alone], until_s=400.0)
    had = sum(job.worked_s for job in many)
    assert 0.7 <= alone.worked_s / had <= 1.4
    assert alone.worked_s + had >= 0.85 * 400.0 * workers
    assert max(job.worked_s for job in many) <= 1.2 * min(job.worked_s for job in many)


@pytest.mark.parametrize("workers", [2, 3, 8])
def test_unused_share_goes_to_other_tenants(workers: int) -> None:
    """A long chain of single tasks leaves all workers but its own and a free one to the rest."""
    chain, wide = Job("chain", 10**6, 1.0, wide=1), Job("wide", 10**6, 1.0)
    run(workers, [chain, wide], until_s=200.0)
    assert chain.worked_s >= 190.0
    assert wide.worked_s >= 190.0 * max(1, workers - 2)


def test_jobs_of_one_tenant_take_turns_for_a_single_worker() -> None:
    jobs = [Job("a", 10**6, 1.0), Job("a", 10**6, 1.0), Job("b", 10**6, 1.0)]
    run(2, jobs, until_s=200.0)
    worked = [job.worked_s for job in jobs]
    assert worked[2] >= 190.0
    assert abs(worked[0] - worked[1]) <= 5.0
    assert worked[0] + worked[1] >= 190.0

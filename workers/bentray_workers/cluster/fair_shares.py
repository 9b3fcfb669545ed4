"""Fair shares of the workers: equal for tenants, then for the jobs of each, task by task."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from distributed import Client

from .connected import connected_workers
from .resources import PRIORITIES, RECONSTRUCTION, SHORT
from .short_lane import LEAVES_S, LONG_LANE, SHORT_LANE

# Tasks in flight for each worker without competition: one running and one ready.
IN_FLIGHT = 2
# How often the workers are counted, s.
COUNT_S = 2.0
# A job without a request for so long has no tasks to submit at present, s.
REQUEST_VALID_S = 1.0
# How long a job without a task in flight waits before it requests again, s.
TURN_S = 0.2


class Share:
    """The share of one job of the workers; see ``Shares``.

    Attributes:
        tenant, lane: owner of the job, and the resource of its tasks.
        in_flight, ready: tasks that are submitted and not finished; tasks that could be submitted.
        begun: number of its last task among all tasks; requested_at: time of its last request, s.
        used_s: time that its tasks were in flight, s.
    """

    def __init__(self, shares: Shares, tenant: str, lane: str, count: Callable[[], int]) -> None:
        self.tenant, self.lane = tenant, lane
        self.in_flight = self.ready = 0
        self.begun, self.requested_at, self.used_s = 0, -REQUEST_VALID_S, 0.0
        self._shares = shares
        self._count = count
        self._workers, self._counted = 1, -COUNT_S

    def may_submit(self, in_flight: int, ready: int) -> bool:
        """Whether to submit one more task now; to be called before each, and again once tasks have finished.

        Args:
            in_flight: submitted and not finished tasks of this job.
            ready: tasks that could be submitted.

        Raises:
            ConnectionError: when the scheduler is not available.
        """
        now = self._shares.clock()
        if now - self._counted >= COUNT_S:
            self._workers, self._counted = max(1, self._count()), now
        return self._shares.decide(self, in_flight, ready, self._workers)

    def pause(self) -> None:
        """Report that nothing is in flight or ready."""
        self._shares.decide(self, 0, 0, self._workers)

    def wait(self) -> None:
        """Wait briefly for a turn; for jobs with nothing in flight to wait for."""
        self._shares.wait(TURN_S)

    def placed(self, placement: Mapping[str, Any]) -> Mapping[str, Any]:
        """Where the next task may run: as given, or in the lane of short jobs while the job is in it."""
        if self.lane != SHORT_LANE or placement.get("resources") != RECONSTRUCTION:
            return placement
        return {**placement, "resources": SHORT}

    def priority(self, in_flight: int) -> float:
        """Dask priority of the next task: by lanes, then the first of a job before the second of others."""
        return PRIORITIES[self.lane] + 1.0 / (1 + in_flight)


class Shares:
    """Divides the workers among the jobs of one service.

    A single tenant uses all workers, with a task ready for each. Several tenants get equal parts: a worker
    is kept free for each that has less than its part, and the rest goes to any tenant with ready tasks. With
    fewer workers than tenants they take turns by the worker time used. The jobs of one tenant divide its part
    equally.

    Args:
        clock: seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock = clock
        self._changed = threading.Condition()
        self._jobs: list[Share] = []
        # Worker time that each tenant has used, s, since it has competitors.
        self._had: dict[tuple[str, str], float] = {}
        self._updated = clock()
        self._begun = 0

    @contextmanager
    def of(self, tenant: str, lane: str, client: Client) -> Iterator[Share]:
        """The share of a job while it runs.

        Args:
            tenant: owner of the job.
            lane: resource of its tasks, as ``recon``.
            client: of the cluster.
        """
        share = self.join(tenant, lane, client)
        try:
            yield share
        finally:
            self._leave(share)

    def join(self, tenant: str, lane: str, client: Client) -> Share:
        """Like ``of``, without an end."""
        share = Share(self, tenant, lane, lambda: len(connected_workers(client)))
        with self._changed:
            self._account()
            self._add(share)
        return share

    def _leave(self, share: Share) -> None:
        with self._changed:
            self._account()
            self._remove(share)

    def _add(self, share: Share) -> None:
        others = [self._had[job.lane, job.tenant] for job in self._jobs if job.lane == share.lane]
        # A new tenant starts with the least worker time of the others.
        self._had.setdefault((share.lane, share.tenant), min(others, default=0.0))
        self._jobs.append(share)

    def _remove(self, share: Share) -> None:
        whose = share.lane, share.tenant
        self._jobs.remove(share)
        if all((job.lane, job.tenant) != whose for job in self._jobs):
            del self._had[whose]
        self._changed.notify_all()

    def decide(self, share: Share, in_flight: int, ready: int, workers: int) -> bool:
        """See ``Share.may_submit``."""
        with self._changed:
            self._account()
            if share.lane == SHORT_LANE and share.used_s > LEAVES_S:
                self._remove(share)
                share.lane = LONG_LANE
                self._add(share)
            fewer = in_flight < share.in_flight
            share.in_flight, share.ready, share.requested_at = in_flight, ready, self.clock()
            may = ready > 0 and self._is_next(share, workers)
            if may:
                share.in_flight += 1
                self._begun += 1
                share.begun = self._begun
            if fewer or not ready:
                self._changed.notify_all()
            return may

    def wait(self, seconds: float) -> None:
        """Wait until something has changed."""
        with self._changed:
            self._changed.wait(seconds)

    def _is_next(self, share: Share, workers: int) -> bool:
        jobs: dict[str, list[Share]] = {}
        for job in self._jobs:
            if job.lane == share.lane:
                jobs.setdefault(job.tenant, []).append(job)
        held = {tenant: sum(job.in_flight for job in of_it) for tenant, of_it in jobs.items()}
        most = self._limit(share, jobs, held, workers)
        if held[share.tenant] >= most:
            return False
        if len(jobs) > workers and not self._has_turn(share, jobs, held, workers):
            return False
        others = [job for job in jobs[share.tenant] if job is not share and self._has_demand(job)]
        return all((share.in_flight, share.begun) <= (job.in_flight, job.begun) for job in others)

    def _limit(self, share: Share, jobs: dict[str, list[Share]], held: dict[str, int], workers: int) -> int:
        """Tasks that the tenant of a job may have in flight."""
        if len(jobs) == 1:
            return IN_FLIGHT * workers
        had = self._had[share.lane, share.tenant]
        equal, reserved = workers // len(jobs), 0
        for tenant, of_it in jobs.items():
            if tenant != share.tenant:
                # The remainder of the division goes to tenants that have used less.
                allowed = equal + (self._had[share.lane, tenant] < had and workers % len(jobs) > 0)
                reserved += min(allowed, held[tenant] + max(1, sum(job.ready for job in of_it)))
        return max(1, equal, workers - reserved)

    def _has_turn(
        self, share: Share, jobs: dict[str, list[Share]], held: dict[str, int], workers: int
    ) -> bool:
        """With more tenants than workers: whether a worker is free, and no waiting tenant has used less.

        A new tenant waits for running tasks of others only, not for their ready ones.
        """
        if not any(job.begun for job in jobs[share.tenant]):
            return True
        if sum(min(1, count) for count in held.values()) >= workers:
            return False
        had = self._had[share.lane, share.tenant]
        return not any(
            self._had[share.lane, tenant] < had
            for tenant, of_it in jobs.items()
            if tenant != share.tenant and not held[tenant] and any(self._has_demand(job) for job in of_it)
        )

    def _has_demand(self, share: Share) -> bool:
        return share.ready > 0 and self.clock() - share.requested_at < REQUEST_VALID_S

    def _account(self) -> None:
        now = self.clock()
        for job in self._jobs:
            used_s = job.in_flight * (now - self._updated)
            job.used_s += used_s
            self._had[job.lane, job.tenant] += used_s
        self._updated = now


def exclusive_share(client: Client, lane: str) -> Share:
    """The share of a single job: all workers."""
    return Shares().join("", lane, client)

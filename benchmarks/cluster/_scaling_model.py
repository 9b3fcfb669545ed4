"""Cost model of one scheduler, fitted to small runs: CPU time for tasks and heartbeats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from distributed.scheduler import heartbeat_interval
from scipy.optimize import nnls

from ._scaling_cluster import Run
from ._scaling_work import Work

DAY_S = 86_400.0

# Largest useful utilisation of a processor: above it, queues grow to the length of tasks.
BUSY = 0.7


def beats(workers: float) -> float:
    """Heartbeats per second of all workers: Dask increases their interval with the number of workers."""
    return workers / float(heartbeat_interval(workers))


@dataclass(frozen=True)
class Model:
    """CPU time of a cluster in addition to its kernels.

    Attributes:
        work: the tasks of one slice.
        scheduler_task: of the scheduler, for each task.
        scheduler_beat: of the scheduler, for each heartbeat of a worker.
        scheduler_idle: of the scheduler, for each second, whatever there is to do.
        driver_task: of the process that submits, for each task.
    """

    work: Work
    scheduler_task: float
    scheduler_beat: float
    scheduler_idle: float
    driver_task: float

    @classmethod
    def fitted(cls, work: Work, runs: Sequence[Run]) -> Model:
        """Fit: idle runs give the cost of heartbeats and seconds, at least 0; the rest is due to tasks."""
        idle = [run for run in runs if not run.tasks]
        terms = np.array([[beats(run.workers) * run.seconds, run.seconds] for run in idle])
        beat, second = map(float, nnls(terms, np.array([run.scheduler for run in idle]))[0])
        driven = [run for run in runs if run.tasks]
        tasks = sum(run.tasks for run in driven)
        rest = sum(run.scheduler - run.seconds * (beats(run.workers) * beat + second) for run in driven)
        return cls(work, rest / tasks, beat, second, sum(run.driver for run in driven) / tasks)

    def scheduler_share(self, workers: float, length: float, used: float = 1.0) -> float:
        """Share of one processor for workers that spend ``used`` of the time in tasks of ``length`` s."""
        tasks = workers * used / length
        return tasks * self.scheduler_task + beats(workers) * self.scheduler_beat + self.scheduler_idle

    def driver_share(self, workers: float, length: float, used: float = 1.0) -> float:
        """Share of one processor for the process that submits."""
        return workers * used * self.driver_task / length

    def most_workers(self, length: float) -> float:
        """Workers that keep the busier of the two processes at ``BUSY``."""
        low, high = 1.0, 1e7
        while high - low > 0.5:
            middle = 0.5 * (low + high)
            share = max(self.scheduler_share(middle, length), self.driver_share(middle, length))
            low, high = (middle, high) if share < BUSY else (low, middle)
        return low

    def length_for(self, workers: float) -> float:
        """Shortest task, s, for which one scheduler serves so many workers."""
        left = BUSY - beats(workers) * self.scheduler_beat - self.scheduler_idle
        scheduler = workers * self.scheduler_task / left if left > 0 else np.inf
        return max(scheduler, workers * self.driver_task / BUSY)

    def workers_for(self, scans_a_day: float, slices: int) -> float:
        """Workers that are busy ``BUSY`` of the time with so many scans."""
        return scans_a_day * slices * self.work.tasks * self.work.seconds / DAY_S / BUSY

    def most_scans_a_day(self, slices: int, length: float) -> float:
        """Most scans a day of one scheduler and one service with unlimited workers."""
        seconds = slices * self.work.tasks * self.work.seconds
        return self.most_workers(length) * DAY_S / seconds

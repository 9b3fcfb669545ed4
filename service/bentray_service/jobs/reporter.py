"""Progress of a running job, stored at a limited rate, and the problem of a failed one."""

import errno
import logging
import secrets
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from distributed import KilledWorker
from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.result import Iteration, Progress

from ..errors import DatabaseUnavailable
from ..rows.job_queue import Queue
from ..web.errors import FAILED, INTERNAL, make_problem, problem_of
from ..web.problem import Problem
from .kinds import finite

log = logging.getLogger("bentray.jobs")

INTERVAL_SECONDS = 0.3
# Maximum number of iterations in a job record; the result file has all of them.
MAX_SWEEPS = 500
# Interval between measurements of the disk usage of a job, s.
MEASURE_SECONDS = 30.0


class Reporter:
    """Stores the progress of one job and polls its state, both at most every ``INTERVAL_SECONDS``.

    Attributes:
        lost: whether another service has taken over the job.
    """

    def __init__(
        self,
        queue: Queue,
        job_id: str,
        leaving: Callable[[], bool],
        clock: Callable[[], float] = time.monotonic,
        taken: Callable[[], int] = lambda: 0,
    ) -> None:
        """Args:
        queue, job_id: the job.
        leaving: whether the service stops.
        clock: seconds.
        taken: measures the disk usage of the job, bytes.
        """
        self._queue = queue
        self._job_id = job_id
        self._leaving = leaving
        self._clock = clock
        self._taken = taken
        self._written = self._asked = -INTERVAL_SECONDS
        self._measured = -MEASURE_SECONDS
        self._pending: Progress | None = None
        self._stopped = self._further = False
        self.lost = False

    def report(self, progress: Progress) -> None:
        """Remember the progress, and store it if the last write is long enough ago, else by ``stop``."""
        self._pending = progress
        self._store()

    def _store(self) -> None:
        """Store the last progress, unless it is stored or the last write is too recent."""
        if self._pending is None:
            return
        # Long histories are stored less often.
        wait = INTERVAL_SECONDS * (1.0 + min(len(self._pending.history), MAX_SWEEPS) / 100.0)
        if self._clock() - self._written < wait:
            return
        with self._tolerant("the progress of %s could not be stored: %s"):
            self.flush()

    @contextmanager
    def _tolerant(self, failure: str) -> Iterator[None]:
        """The job continues while the database is unavailable; the next report is complete."""
        try:
            yield
        except DatabaseUnavailable:
            pass
        except SQLAlchemyError as error:
            log.warning(failure, self._job_id, error)

    def flush(self) -> None:
        """Store the last progress; called at the end, too."""
        if self._pending is None:
            return
        progress = self._pending
        self._written = self._clock()
        history: list[dict[str, Any]] = [
            {**asdict(sweep), "residual_rms_s": finite(sweep.residual_rms_s)}
            for sweep in thin_history(progress.history)
        ]
        self._queue.progress(self._job_id, progress.done, progress.total, history, progress.phase)
        self._pending = None

    def saved(self) -> None:
        """Reset the attempts after the first checkpoint, and measure the disk usage now and then."""
        with self._tolerant("a checkpoint of %s could not be recorded: %s"):
            if not self._further:
                self._queue.reset_attempts(self._job_id)
                self._further = True
            if self._clock() - self._measured >= MEASURE_SECONDS:
                self._measured = self._clock()
                self._queue.record_size(self._job_id, self._taken())

    def stop(self) -> bool:
        """Whether to stop: after a cancellation or takeover, or when this service stops."""
        if self._leaving() or self._stopped:
            return True
        # A report that came soon after another is not kept back until a long task ends.
        self._store()
        if self._clock() - self._asked >= INTERVAL_SECONDS:
            self._asked = self._clock()
            with self._tolerant("the state of %s could not be read: %s"):
                state = self._queue.held_state(self._job_id)
                self.lost = state is None
                self._stopped = state != "running"
        return self._stopped


def thin_history(history: Sequence[Iteration]) -> Sequence[Iteration]:
    """At most ``MAX_SWEEPS`` entries of a history, evenly spaced, including the first and the last."""
    if len(history) <= MAX_SWEEPS:
        return history
    last = len(history) - 1
    return [history[k * last // (MAX_SWEEPS - 1)] for k in range(MAX_SWEEPS)]


CRASHED = make_problem(
    FAILED, "the service crashed several times while it ran this job; the job is not repeated"
)


def explain(job_id: str, error: BaseException) -> Problem:
    """Convert an error to a problem; unexpected errors are logged with a correlation id."""
    instance = f"/v1/jobs/{job_id}"
    if isinstance(error, InvalidInput):
        return problem_of(error, instance)
    if isinstance(error, MemoryError):
        return make_problem(FAILED, "out of memory: use fewer nodes or fewer slices", instance=instance)
    if isinstance(error, KilledWorker):
        words = "the workers that ran this job died one after another, usually for lack of memory"
        return make_problem(FAILED, words, instance=instance)
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return make_problem(FAILED, "the disk of the service is full", instance=instance)
    number = secrets.token_hex(8)
    log.error("job %s failed [%s]", job_id, number, exc_info=error)
    words = f"internal error of the service; see the log entry {number}"
    return make_problem(INTERNAL, words, instance=instance, correlation_id=number)

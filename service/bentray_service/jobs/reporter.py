"""Between a job that reports often and a database that is written a few times a second."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from bentray_kernels.tomography.result import Progress, Sweep

from ..refusals import DatabaseUnavailable
from ..rows.job_queue import Queue
from .kinds import finite

log = logging.getLogger("bentray.jobs")

INTERVAL_SECONDS = 0.3
# Of how many sweeps the record of a job tells at most; the file of the result has all of them.
MOST_SWEEPS = 500
# How often a job that has kept something is asked how much that takes on the disk.
MEASURE_SECONDS = 30.0


class Reporter:
    """Stores the progress of one job and asks whether to stop, both at most every ``INTERVAL_SECONDS``.

    Attributes:
        lost: whether another service runs the job by now.
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
        queue, job_id: which job.
        leaving: whether the service leaves.
        clock: seconds.
        taken: measures how many bytes the job takes on the disk.
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
        """Keep the newest progress; write it when the last write is long enough ago."""
        self._pending = progress
        # A long history is a long record to write.
        wait = INTERVAL_SECONDS * (1.0 + min(len(progress.history), MOST_SWEEPS) / 100.0)
        if self._clock() - self._written < wait:
            return
        try:
            self.flush()
        except DatabaseUnavailable:
            # A database that is away for a while must not cost a job; the next report says the same.
            pass
        except SQLAlchemyError:
            log.warning("the progress of %s could not be stored", self._job_id, exc_info=True)

    def flush(self) -> None:
        """Write what is kept; called at the end too, so that the last report always arrives."""
        if self._pending is None:
            return
        kept = self._pending
        self._written = self._clock()
        history: list[dict[str, Any]] = [
            {**asdict(sweep), "residual_rms_s": finite(sweep.residual_rms_s)}
            for sweep in thin_history(kept.history)
        ]
        self._queue.progress(self._job_id, kept.done, kept.total, history, kept.phase)
        self._pending = None

    def saved(self) -> None:
        """The job has kept something to go on from: say so once, and now and then how much that takes."""
        try:
            if not self._further:
                self._queue.reset_attempts(self._job_id)
                self._further = True
            if self._clock() - self._measured >= MEASURE_SECONDS:
                self._measured = self._clock()
                self._queue.record_size(self._job_id, self._taken())
        except DatabaseUnavailable:
            pass
        except SQLAlchemyError:
            log.warning("that %s got further could not be stored", self._job_id, exc_info=True)

    def stop(self) -> bool:
        """Whether the job should give up: it was cancelled or lost to another service, or this one leaves."""
        if self._leaving() or self._stopped:
            return True
        if self._clock() - self._asked >= INTERVAL_SECONDS:
            self._asked = self._clock()
            try:
                told = self._queue.held_state(self._job_id)
                self.lost = told is None
                self._stopped = told != "running"
            except DatabaseUnavailable:
                pass
            except SQLAlchemyError:
                log.warning("whether %s is cancelled could not be read", self._job_id, exc_info=True)
        return self._stopped


def thin_history(history: Sequence[Sweep]) -> Sequence[Sweep]:
    """At most ``MOST_SWEEPS`` of a history, evenly, with the first and the last."""
    if len(history) <= MOST_SWEEPS:
        return history
    last = len(history) - 1
    return [history[k * last // (MOST_SWEEPS - 1)] for k in range(MOST_SWEEPS)]

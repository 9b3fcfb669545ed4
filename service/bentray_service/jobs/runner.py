"""The threads that take queued jobs in order and see each to its end."""

from __future__ import annotations

import logging
import threading
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from bentray_workers.slices import Cancelled

from ..compute import Compute
from ..storage.files import Files
from ..storage.ids import volume_of
from ..storage.jobs import Jobs
from .failures import CRASHED, explain
from .kinds import KINDS, Task
from .reporter import Reporter

log = logging.getLogger("bentray.jobs")

# How long an idle thread waits before it looks by itself; a new job wakes it at once.
IDLE_SECONDS = 1.0


class Runner:
    """Runs up to ``at_once`` jobs at the same time.

    A thread only drives its job: the work is done by the cluster.
    """

    def __init__(self, jobs: Jobs, files: Files, compute: Compute, at_once: int) -> None:
        self._jobs = jobs
        self._files = files
        self._compute = compute
        self._wake = threading.Condition()
        self._leaving = threading.Event()
        self._threads = [
            threading.Thread(target=self._loop, name=f"job-{i}", daemon=True) for i in range(at_once)
        ]

    def start(self) -> None:
        """Take up what a dead process left, then begin."""
        again = self._jobs.recover(CRASHED.model_dump(exclude_none=True))
        if again:
            log.warning("%d jobs of a service that died wait again", again)
        for thread in self._threads:
            thread.start()

    def notify(self) -> None:
        """Say that a job has been queued."""
        with self._wake:
            self._wake.notify()

    def alive(self) -> bool:
        """Whether every thread is there."""
        return all(thread.is_alive() for thread in self._threads)

    def stop(self) -> None:
        """Stop the running jobs, put them back in the queue and end the threads."""
        self._leaving.set()
        with self._wake:
            self._wake.notify_all()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    def _loop(self) -> None:
        while not self._leaving.is_set():
            try:
                job = self._jobs.claim()
                if job is not None:
                    self._run(job)
                    continue
            except SQLAlchemyError:
                # The thread must outlive a database that is away for a while.
                log.exception("the database refused; trying again in %g s", IDLE_SECONDS)
            with self._wake:
                self._wake.wait(IDLE_SECONDS)

    def _run(self, job: dict[str, Any]) -> None:
        reporter = Reporter(self._jobs, job["id"], self._leaving.is_set)
        volume_id = volume_of(job["id"])
        target = self._files.volume(volume_id)
        try:
            with TemporaryDirectory(dir=self._files.scratch) as work_dir:
                volume = KINDS[job["kind"]].run(
                    Task(
                        client=self._compute.client,
                        dataset=self._files.dataset(job["dataset_id"]),
                        settings=job["settings"],
                        target=target,
                        work_dir=Path(work_dir),
                        on_progress=reporter.report,
                        stop=reporter.stop,
                    )
                )
            reporter.flush()
        except Cancelled:
            reporter.flush()
            if self._leaving.is_set():
                self._jobs.release(job["id"])
            else:
                self._jobs.cancelled(job["id"])
        except Exception as error:
            reporter.flush()
            self._jobs.fail(job["id"], explain(job["id"], error).model_dump(exclude_none=True))
        else:
            if not self._jobs.succeed(job["id"], {"id": volume_id, **volume}):
                target.unlink(missing_ok=True)
                self._jobs.cancelled(job["id"])

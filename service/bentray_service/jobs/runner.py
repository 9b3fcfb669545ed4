"""The threads that take queued jobs in order and see each to its end."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from bentray_workers.slices import Cancelled

from ..compute import Compute
from ..storage.files import Files
from ..storage.jobs import Jobs
from .failures import CRASHED, explain
from .kinds import KINDS, Task
from .reporter import Reporter

log = logging.getLogger("bentray.jobs")

# How long an idle thread waits before it looks by itself; a new job wakes it at once.
IDLE_SECONDS = 1.0
# How long a job may take to notice that the service leaves.
STOP_SECONDS = 30.0


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
            thread.join(STOP_SECONDS)
            if thread.is_alive():
                log.warning(
                    "%s did not stop in %g s; its job runs again at the next start", thread.name, STOP_SECONDS
                )

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
        kind = KINDS[job["kind"]]
        target = kind.target(self._files, job)
        try:
            with TemporaryDirectory(dir=self._files.scratch) as work_dir:
                volume = kind.run(
                    Task(
                        client=self._compute.client,
                        source=kind.source(self._files, job),
                        settings=job["settings"],
                        target=target,
                        work_dir=Path(work_dir),
                        on_progress=reporter.report,
                        stop=reporter.stop,
                    )
                )
        except Cancelled:
            self._settle(lambda: self._stopped(job["id"], reporter))
        except Exception as error:
            problem = explain(job["id"], error).model_dump(exclude_none=True)
            self._settle(lambda: self._failed(job["id"], reporter, problem))
        else:
            self._settle(lambda: self._succeeded(job["id"], reporter, volume, target))

    def _stopped(self, job_id: str, reporter: Reporter) -> None:
        reporter.flush()
        if self._leaving.is_set():
            self._jobs.release(job_id)
        else:
            self._jobs.cancelled(job_id)

    def _failed(self, job_id: str, reporter: Reporter, problem: dict[str, Any]) -> None:
        reporter.flush()
        self._jobs.fail(job_id, problem)

    def _succeeded(
        self, job_id: str, reporter: Reporter, volume: dict[str, Any] | None, target: Path
    ) -> None:
        reporter.flush()
        if not self._jobs.succeed(job_id, volume):
            target.unlink(missing_ok=True)
            self._jobs.cancelled(job_id)

    def _settle(self, write_the_end: Callable[[], None]) -> None:
        """Write the end of a job, as often as it takes: it would count as running for ever otherwise."""
        while True:
            try:
                return write_the_end()
            except SQLAlchemyError:
                log.exception("the end of a job could not be stored; trying again in %g s", IDLE_SECONDS)
                if self._leaving.wait(IDLE_SECONDS):
                    raise
